"""Stages that take known errors of the measurement off a record before anything is estimated."""
