"""Whether a torque differs from the robot's by a constant: a sensor's zero, or a weight that the robot file lacks.

Where the axis moves about one pose only, the two look alike, and the zero of an angle looks alike at one axis, too
(`zero_angles`). Friction is free, as there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.estimation.rigid.mended import shares
from robid_core.estimation.rigid.plausibility import GAIN, LEFT, NOTICED, Recorded


@dataclass(frozen=True)
class Offset:
    """A recorded torque that differs from the robot's by a constant."""

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
    for axis, before in enumerate(shares(recorded).tolist()):
        size, after = recorded.beside_friction(axis, rest[:, axis], one, -one)
        if before > NOTICED and before > GAIN * after and after < LEFT:
            found.append(Offset(axis, float(size[0] - size[1]), before**0.5, after**0.5))
    return found
