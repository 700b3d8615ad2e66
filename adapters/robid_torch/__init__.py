"""Dynamics, responses, their derivatives and poses of many configurations at once, by torch in double precision."""
