"""Springs that turn about one line at every pose: their stiffnesses are not told apart by structure.

A bearing, or an elastic joint, stands in series with the gear of the next axis where both turn about the same line.
Only the bodies between them keep the two apart: as far as the inertia of these about the line is small, motors feel one
spring of compliance ``1 / k_bearing + 1 / k_gear`` alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.robot.file.description import Body, RobotDescription

_PARALLEL = 1e-6  # sine of the angle between two lines that are one
_DISTANCE = 1e-6  # m between them


@dataclass(frozen=True)
class CoaxialSprings:
    """Two springs about one line."""

    first: str
    """Name of the first one's stiffness, as `bearing_stiffness.axis_3_z`."""
    axis: str
    """The axis whose gear is the second one."""
    inertia: float
    """Of the bodies between them about the line, kg m^2."""

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"{self.first} and gear_stiffness.{self.axis} turn about one line, with {self.inertia:.2g} kg m^2 between "
            "them: not identifiable by structure; leave the first one out, or hold one of them "
            f"(fixed: [{self.first}])"
        )


def coaxial_springs(description: RobotDescription) -> Iterator[CoaxialSprings]:
    """Yield bearings and elastic joints that turn about the line of the next axis, whose gear is elastic."""
    axis_of = {axis.joint or name: name for name, axis in description.axes.items() if axis.gear is not None}
    for name, bearing in description.bearings.items():
        yield from _behind(
            description, f"bearing_stiffness.{name}", bearing.joint, np.array(bearing.axis), axis_of
        )
    for body in description.bodies:
        if body.elastic is not None and body.type == "revolute":
            yield from _behind(
                description, f"bearing_stiffness.{body.joint}", body.joint, np.array(body.axis), axis_of
            )


def _behind(
    description: RobotDescription, first: str, joint: str, line: FloatArray, axis_of: dict[str, str]
) -> Iterator[CoaxialSprings]:
    """Follow the joints behind one as long as all that is between lies on the line and slides along it at most."""
    start = next(body for body in description.bodies if body.joint == joint)
    waiting = [(start, np.zeros(3), line / np.linalg.norm(line), _moment(start, np.zeros(3), line))]
    while waiting:
        at, foot, direction, inertia = waiting.pop()
        for body in description.bodies:
            if body.parent != at.joint:
                continue
            turned, away = np.array(body.rotation), np.array(body.translation) - foot
            along = turned.T @ direction
            if np.linalg.norm(np.cross(along, body.axis)) > _PARALLEL:
                continue
            if body.type == "prismatic":
                foot_behind = -turned.T @ away
                more = _moment(body, foot_behind, along)
                waiting.append((body, foot_behind, along, inertia + more))
            elif np.linalg.norm(np.cross(away, direction)) <= _DISTANCE and body.joint in axis_of:
                yield CoaxialSprings(first, axis_of[body.joint], inertia)


def _moment(body: Body, foot: FloatArray, line: FloatArray) -> float:
    """Inertia of a body about a line through `foot`, in the joint's frame, kg m^2."""
    direction = line / np.linalg.norm(line)
    lever = np.cross(np.array(body.centre_of_mass) - foot, direction)
    return float(direction @ np.array(body.inertia) @ direction + body.mass * lever @ lever)
