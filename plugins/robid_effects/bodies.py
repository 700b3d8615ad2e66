"""Bodies of a robot's description: found by the name of a joint or axis, changed, and checked again.

What the structure effects share. They change the description only; chain and matrices follow from it.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from pydantic import ValidationError

from robid_core import ConfigurationError, Robot


def body_index(robot: Robot, on: str | None, label: str) -> int:
    """Return the index of the body that a joint or axis carries; the last body where `on` is None.

    Raises ConfigurationError where the robot has no joint or axis of that name.
    """
    joints = [body.joint for body in robot.description.bodies]
    if on is None:
        return len(joints) - 1
    axis = robot.description.axes.get(on)
    joint = on if axis is None or on in joints else axis.joint
    if joint not in joints:
        names = dict.fromkeys([*joints, *robot.description.axes])
        raise ConfigurationError(f"effects.{label}: there is no body '{on}'; there are {', '.join(names)}")
    return joints.index(joint)


def with_body(robot: Robot, index: int, label: str, **changes: Any) -> Robot:
    """Return the robot with some fields of one body changed; raises ConfigurationError for no rigid body."""
    bodies = list(robot.description.bodies)
    old = bodies[index]
    fields = {name: getattr(old, name) for name in type(old).model_fields}
    try:
        bodies[index] = type(old).model_validate(fields | changes)
    except ValidationError as error:
        raise ConfigurationError(f"effects.{label}: body '{old.joint}': {_first(error)}") from error
    description = robot.description.model_copy(update={"bodies": tuple(bodies)})
    return dataclasses.replace(robot, description=description)


def with_sections(robot: Robot, label: str, **sections: Any) -> Robot:
    """Return the robot with whole sections of its description replaced by plain data, everything checked again.

    Raises ConfigurationError where the new description contradicts itself.
    """
    data = robot.description.model_dump(by_alias=True) | sections
    try:
        description = type(robot.description).model_validate(data)
    except ValidationError as error:
        raise ConfigurationError(f"effects.{label}: {_first(error)}") from error
    return dataclasses.replace(robot, description=description)


def _first(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    return f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}"
