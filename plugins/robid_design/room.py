"""Room about a robot: which configurations stay above the floor and keep the robot's links apart.

Links are capsules of one radius (Ch. Ericson, Real-Time Collision Detection, 2005, section 5.1.9) about the lines from
axis to axis, and from the last axis to the tool, or to the centre of mass of the last body. Poses come from what the
robot computes its dynamics with, elastic coordinates sagging under gravity.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from pydantic import NonNegativeFloat

from robid_core import BoolArray, FloatArray, IntArray, Robot, Settings

MOST = 6  # configurations that are named


class Room(Settings):
    """Floor, link radius and tool that keep configurations free of collisions; motions about them need more room.

    where: {use: design.candidates, with: {count: 4, room: {floor_m: 0.0, link_radius_m: 0.08}}}
    """

    floor_m: float | None = None
    """Height of the floor over the base's origin, along the base's z axis; null: there is none."""
    link_radius_m: NonNegativeFloat = 0.0
    """Of all links. Above zero, links come no nearer to each other than twice this. Neighbours are left out, and pairs
    that are nearer in the zero position already: such capsules are too wide to show a collision."""
    tool_m: tuple[float, float, float] | None = None
    """Tip of the tool in the frame of the last body; null: its centre of mass."""

    def is_kept(self, robot: Robot, joint: FloatArray) -> BoolArray:
        """Tell which configurations keep clear.

        Parameters
        ----------
        robot
            The robot.
        joint
            Its joint coordinates, shape (n_config, n_joint); rows that are NaN are not clear.
        """
        links = link_ends(robot)
        points = link_points(robot, joint, self.tool_m)
        kept: BoolArray = np.asarray(np.isfinite(points).all(axis=(1, 2)))
        if self.floor_m is not None:
            height = points[:, _moving(robot), 2].min(axis=1)
            np.logical_and(kept, height - self.link_radius_m >= self.floor_m, out=kept)
        if self.link_radius_m > 0:
            home = link_points(robot, np.zeros((1, joint.shape[1])), self.tool_m)
            for one, other in combinations(range(len(links)), 2):
                if set(links[one]) & set(links[other]):
                    continue
                if distance_of_lines(home, links[one], links[other])[0] > 2 * self.link_radius_m:
                    apart = distance_of_lines(points, links[one], links[other]) > 2 * self.link_radius_m
                    np.logical_and(kept, apart, out=kept)
        return kept


def below_base(robot: Robot, angle: FloatArray) -> str:
    """Say which poses of joint-side angles, (n_config, n_axis), reach below the base; empty where none does."""
    points = link_points(robot, robot.equilibrium(angle).joint)
    height = points[:, _moving(robot), 2].min(axis=1)
    low = np.flatnonzero(height < 0)
    if not len(low):
        return ""
    which = ", ".join(str(number + 1) for number in low[:MOST].tolist())
    which += f" and {len(low) - MOST} more" if len(low) > MOST else ""
    many = len(low) > 1
    return (
        f"configuration{'s' if many else ''} {which} of {len(angle)} reach{'' if many else 'es'} "
        f"{-float(height.min()):.2g} m below the plane of the base; where the robot stands on a floor, set room: "
        "{floor_m: 0}, else floor_m to where there is one"
    )


def link_points(
    robot: Robot, joint: FloatArray, tool: tuple[float, float, float] | None = None
) -> FloatArray:
    """Origin of the base, of the frame of each axis, and the end of each last body.

    Parameters
    ----------
    robot
        The robot; its `dynamics` computes the poses.
    joint
        Joint coordinates, shape (n_config, n_joint).
    tool
        Point of the last body in its frame, m; None: its centre of mass.

    Returns
    -------
    m, base axes, shape (n_config, 1 + n_axis + n_end, 3).
    """
    chain = robot.chain
    points = [np.zeros((len(joint), 3))]
    points += [robot.batches.pose_of(chain, joint, chain.names[j]).position for j in robot.mechanism.arm]
    for end in _ends(robot):
        point = chain.centre_of_mass[end] if tool is None else np.array(tool)
        points.append(robot.batches.pose_of(chain, joint, chain.names[end], point).position)
    return np.stack(points, axis=1)


def link_ends(robot: Robot) -> list[tuple[int, int]]:
    """Return the lines of the links as numbers of `link_points`."""
    arm = robot.mechanism.arm.tolist()
    ends = [(_axis_above(robot, j), 1 + axis) for axis, j in enumerate(arm)]
    return ends + [
        (1 + arm.index(end) if end in arm else _axis_above(robot, end), 1 + len(arm) + number)
        for number, end in enumerate(_ends(robot))
    ]


def distance_of_lines(points: FloatArray, one: tuple[int, int], other: tuple[int, int]) -> FloatArray:
    """Smallest distance of two lines between points, m, shape (n_config,); lines may have no length.

    Parameters
    ----------
    points
        Shape (n_config, n_point, 3).
    one, other
        Numbers of the ends of each line.
    """
    start, far = points[:, one[0]], points[:, other[0]]
    along, across = points[:, one[1]] - start, points[:, other[1]] - far
    between = start - far
    a, e = (along**2).sum(axis=1), (across**2).sum(axis=1)
    f, c, b = ((v * w).sum(axis=1) for v, w in ((across, between), (along, between), (along, across)))
    area = a * e - b**2
    crossed = area > 1e-14 * a * e
    s = np.clip(np.where(crossed, b * f - c * e, 0.0) / np.where(crossed, area, 1.0), 0.0, 1.0)
    t = np.clip((b * s + f) / np.where(e > 0, e, 1.0), 0.0, 1.0)
    s = np.clip((b * t - c) / np.where(a > 0, a, 1.0), 0.0, 1.0)
    nearest: FloatArray = np.linalg.norm(between + s[:, None] * along - t[:, None] * across, axis=1)
    return nearest


def _ends(robot: Robot) -> list[int]:
    """Return the joints on which nothing hangs."""
    return [j for j in range(robot.chain.n_coordinate) if j not in robot.chain.parent]


def _axis_above(robot: Robot, joint: int) -> int:
    """Return the point of the axis that carries a joint; 0 is the base."""
    arm, parent = robot.mechanism.arm.tolist(), int(robot.chain.parent[joint])
    while parent >= 0 and parent not in arm:
        parent = int(robot.chain.parent[parent])
    return 1 + arm.index(parent) if parent >= 0 else 0


def _moving(robot: Robot) -> IntArray:
    """Return the points that some axis moves: not the base, nor where an axis stands on it."""
    return np.array([end for start, end in link_ends(robot) if start > 0], dtype=np.int64)
