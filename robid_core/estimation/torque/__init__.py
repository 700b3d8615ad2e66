"""The torque residual: measured motor torque against what the measured motion takes, in every bin of the spectrum."""
