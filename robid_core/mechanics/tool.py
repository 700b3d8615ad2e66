"""Where a body of a chain is, and how it moves with the joints, at many positions at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.mechanics.chain import Chain


@dataclass(frozen=True)
class Pose:
    """A point of a body in world axes; leading axes are those of the joint positions."""

    rotation: FloatArray
    """Axes of the body's frame as columns, (..., 3, 3)."""
    position: FloatArray
    """Of the point, m, (..., 3)."""
    jacobian: FloatArray
    """[angular velocity; velocity of the point] per joint rate, (..., 6, n_joint)."""


def pose_of(chain: Chain, position: FloatArray, body: str, point: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Pose:
    """Pose and Jacobian of a point that is fixed to a body.

    Parameters
    ----------
    chain
        The mechanism.
    position
        Joint coordinates, rad or m, shape (..., n_joint).
    body
        Name of the joint that carries the body.
    point
        In the body's frame, m, shape (3,).
    """
    q = np.asarray(position, dtype=np.float64)
    lineage = [chain.index(body)]
    while chain.parent[lineage[0]] >= 0:
        lineage.insert(0, int(chain.parent[lineage[0]]))
    turning, sliding = chain.turning_axis, chain.sliding_axis
    axes = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
    origin = np.zeros((*q.shape[:-1], 3))
    screws = []
    for j in lineage:
        origin = origin + axes @ chain.translation[j]
        axes = axes @ chain.rotation[j]
        slide, turn = axes @ sliding[j], axes @ turning[j]
        origin = origin + slide * q[..., j, None]
        axes = axes @ _turn(turning[j], q[..., j])
        screws.append((j, turn, slide, origin))
    end = origin + axes @ np.asarray(point, dtype=np.float64)
    jacobian = np.zeros((*q.shape[:-1], 6, chain.n_coordinate))
    for j, turn, slide, start in screws:
        jacobian[..., :3, j] = turn
        jacobian[..., 3:, j] = slide + np.cross(turn, end - start)
    return Pose(axes, end, jacobian)


def turned_by(actual: FloatArray, wanted: FloatArray) -> FloatArray:
    """Small rotation vector from `wanted` to `actual`, world axes, rad; exact to third order, (..., 3)."""
    relative = actual @ np.swapaxes(wanted, -1, -2)
    skew = (relative - np.swapaxes(relative, -1, -2)) / 2
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)


def _turn(vector: FloatArray, amount: FloatArray) -> FloatArray:
    """Rotations exp([vector] amount) for one vector and many amounts, (..., 3, 3)."""
    length = float(np.linalg.norm(vector))
    if length == 0:
        return np.broadcast_to(np.eye(3), (*amount.shape, 3, 3))
    x, y, z = vector / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = (length * amount)[..., None, None]
    turned: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    return turned
