"""Fit: parameters of the robot from frequency responses (log_response) and from motion (rigid)."""
