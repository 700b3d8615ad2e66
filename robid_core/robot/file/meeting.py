"""Springs about lines that meet in one point at two joints: motors determine fewer stiffnesses than there are.

Where two joints have one origin, the springs of both bend about lines through it. Their compliances add up to a matrix,
``sum_i c_i d_i d_i^T`` with the directions ``d_i`` in the frame between the joints, of which those behind turn with the
second joint. A combination of compliances that is zero at each of its angles is felt by no motor, but for the inertia
of the body between: a tilt in two directions behind is, in sum, a tilt before and a twist of the gear before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from robid_core.arrays import FloatArray
from robid_core.robot.file.description import Body, RobotDescription

_ANGLES = (
    2 * np.pi * np.arange(7) / 7
)  # of the joint: quadratic functions of cosine and sine have five unknowns
_SAME = 1e-6  # m between two origins that are one; sine of the angle between two lines that are one
_NOTHING = 1e-9  # of the largest singular value


@dataclass(frozen=True)
class MeetingSprings:
    """Springs of which one too many is free."""

    names: tuple[str, ...]
    """Of the stiffnesses, first those before the joint."""
    joint: str
    """At whose origin the lines meet."""
    least: str
    """The one to leave out: the first bearing behind the joint."""

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"{', '.join(self.names[:-1])} and {self.names[-1]} turn about lines that meet in one point, the origin of "
            f"'{self.joint}': motors determine one stiffness less than these, not identifiable by structure; leave "
            f"{self.least} out, or hold it (fixed: [{self.least}])"
        )


def dependent_springs(
    before: Mapping[str, FloatArray], behind: Mapping[str, FloatArray], body: Body
) -> tuple[str, ...]:
    """Return the names of springs that take part in a combination which no motor feels.

    Parameters
    ----------
    before
        Directions of springs in the frame before the joint, (3,) each. Those on the joint's own line are left out: they
        are in series with its gear.
    behind
        Directions in the frame behind the joint.
    body
        What the joint carries, its origin where the lines of `before` meet.
    """
    turned, axis = np.array(body.rotation), np.array(body.axis)
    first = {
        name: direction
        for name, direction in before.items()
        if np.linalg.norm(np.cross(direction, turned @ axis)) > _SAME * np.linalg.norm(direction)
    }
    names, columns = (*first, *behind), []
    turns = Rotation.from_rotvec(np.outer(_ANGLES, axis)).as_matrix()
    for name in names:
        poses = [np.eye(3) if name in first else turned @ one for one in turns]
        directions = np.array([pose @ (first | dict(behind))[name] for pose in poses])
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        columns.append((directions[:, :, None] * directions[:, None, :]).ravel())
    if len(names) < 2:
        return ()
    _, size, rows = np.linalg.svd(np.array(columns).T, full_matrices=False)
    unfelt = rows[size < _NOTHING * size[0]]
    part = np.abs(unfelt).max(axis=0, initial=0.0) > _SAME
    return tuple(name for name, takes in zip(names, part, strict=True) if takes)


def has_origin_of_parent(body: Body) -> bool:
    """Whether a joint's frame has the origin of the one before it."""
    return bool(np.linalg.norm(body.translation) <= _SAME)


def meeting_springs(description: RobotDescription) -> Iterator[MeetingSprings]:
    """Yield the sets of springs at each turning joint that has the origin of the one before it."""
    by_joint = {body.joint: body for body in description.bodies}
    for body in description.bodies:
        parent = by_joint.get(body.parent or "")
        if parent is None or body.type != "revolute" or parent.type != "revolute":
            continue
        if not has_origin_of_parent(body):
            continue
        behind = _springs_of(description, body)
        names = dependent_springs(_springs_of(description, parent), behind, body)
        least = next((name for name in names if name in behind and name.startswith("bearing")), "")
        if least:
            yield MeetingSprings(names, body.joint, least)


def _springs_of(description: RobotDescription, body: Body) -> dict[str, FloatArray]:
    """Directions of a joint's gear and bearings in the frame behind it, by the names of their stiffnesses."""
    gears = {
        f"gear_stiffness.{name}": np.array(body.axis, dtype=np.float64)
        for name, axis in description.axes.items()
        if (axis.joint or name) == body.joint and axis.gear is not None
    }
    bearings = {
        f"bearing_stiffness.{name}": np.array(bearing.axis, dtype=np.float64)
        for name, bearing in description.bearings.items()
        if bearing.joint == body.joint
    }
    return gears | bearings
