"""Recordings in bags of ROS 1 and ROS 2, read as named arrays; needs the extra `formats` (rosbags)."""
