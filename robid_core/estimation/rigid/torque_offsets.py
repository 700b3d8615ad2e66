"""Whether a torque differs from the robot's by a constant: a sensor's zero, or a weight that the robot file lacks.

Where the axis moves about one pose only, the two look alike, and the zero of an angle looks alike at one axis, too
(`zero_angles`). Friction is free, as there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.estimation.rigid.plausibility import GAIN, LEFT, NOTICED, Recorded


@dataclass(frozen=True)
class Offset:
    """A torque that is the robot's but for a constant."""

    axis: int
    torque: float
    """Recorded torque less that of the robot, N m."""
    before: float
    """Share of the torque that the robot leaves, rms."""
    after: float
    """Likewise, once the constant is taken off."""


def offsets_in(recorded: Recorded) -> list[Offset]:
    """Return the torques that a constant makes fit the robot; none where they fit already.

    Parameters
    ----------
    recorded
        What was recorded, below the robot's first resonance.
    """
    found = []
    rest = recorded.torque - recorded.rigid - recorded.drives.offset
    one = np.ones(len(rest))
    for axis in range(recorded.drives.n_axis):
        power = max(float((recorded.torque[:, axis] ** 2).sum()), 1e-300)
        friction = [recorded.direction[:, axis], recorded.velocity[:, axis]]
        _, before = _fitted(friction, rest[:, axis], power)
        size, after = _fitted([*friction, one, -one], rest[:, axis], power)
        if before > NOTICED and before > GAIN * after and after < LEFT:
            found.append(Offset(axis, float(size[2] - size[3]), before**0.5, after**0.5))
    return found


def _fitted(columns: list[FloatArray], rest: FloatArray, power: float) -> tuple[FloatArray, float]:
    """Sizes, none negative, of columns that explain most of a torque, and the share of its power that is left."""
    matrix = np.stack(columns, axis=1)
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    size, left = scipy.optimize.nnls(matrix / scale, rest)
    return size / scale, left**2 / power
