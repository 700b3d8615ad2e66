"""Robot: what its file says (description), how it is read, its arrays, the model itself and its plant."""

from robid_core.robot.arrays import DriveArrays
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.robot import Robot

__all__ = ["DriveArrays", "Robot", "RobotDescription"]
