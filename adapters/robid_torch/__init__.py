"""Dynamics and responses of many configurations at once, by torch in double precision."""
