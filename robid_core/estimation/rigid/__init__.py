"""Torque of rigid bodies as a linear function of their parameters, and regressions on it."""
