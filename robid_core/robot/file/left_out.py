"""What a robot file may leave out of its axes, and what is said where something asks for it; recordings do not."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from robid_core.robot.file.axis import Axis
from robid_core.robot.file.description import RobotDescription
from robid_core.yaml_file.model_fields import first_line

AxisKey = Literal["torque_limit", "speed_limit", "controller"]
"""Keys of `axes` that a robot file may leave out."""


def left_out(description: RobotDescription, keys: Iterable[AxisKey]) -> str:
    """Say which of the keys a robot file left out, and at which axes; empty where it has all of them."""
    missing = {
        key: [name for name, axis in description.axes.items() if not _is_told(axis, key)] for key in keys
    }
    told = [
        f"{key} of {', '.join(names)} ({first_line(Axis.model_fields[key]).partition(';')[0]})"
        for key, names in missing.items()
        if names
    ]
    return (
        f"the robot file of {description.name} lacks {' and '.join(told)}; add it under axes" if told else ""
    )


def _is_told(axis: Axis, key: AxisKey) -> bool:
    """Whether an axis has a key; a servo is a controller, and its voltage a limit of the torque."""
    by_servo = axis.servo is not None and key in ("controller", "torque_limit")
    return by_servo or getattr(axis, key) is not None
