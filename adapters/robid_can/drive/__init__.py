"""The drive's side: virtual CiA 402 drives with a plant behind them, in lock-step simulated time."""

from robid_can.drive.node import DriveNode, Nameplate
from robid_can.drive.system import DriveSystem

__all__ = ["DriveNode", "DriveSystem", "Nameplate"]
