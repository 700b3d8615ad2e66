"""What of torque and motion is not linear, and what makes it: friction, ripple, the speed they were met at."""
