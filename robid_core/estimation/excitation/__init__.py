"""What is asked of the motors: signals and trajectories, what they reach, and what they promise."""
