"""Whether an angle was scaled by a wrong number of counts per turn: a half, twice, a quarter or four times as many.

Encoders count edges once, twice or four times, so that these are the factors which a scale is wrong by. Inertia scales
with such a factor, weight does not, by which it is told from a torque's scale. Friction hides it: where inertia and
weight are little of a torque, nothing is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.rigid.mended import explained, mends, shares
from robid_core.estimation.rigid.plausibility import NOTICED, TIE, Recorded, Slip

FACTORS = {2.0: "half", 0.5: "twice", 4.0: "a quarter of", 0.25: "four times"}


@dataclass(frozen=True)
class Counts:
    """An axis whose recorded angle is a simple multiple of the true one (wrong counts per turn)."""

    axis: int
    factor: float
    """By which the recorded angle is to be multiplied."""
    before: float
    """Share of the torque that the robot leaves, rms, at the axis that it leaves most of; as recorded."""
    after: float
    """Likewise, once the angle is mended."""
    explained: float
    """Logarithm of what is left less, over all axes."""

    @property
    def multiple(self) -> str:
        """Recorded angle over the real one, in words."""
        return FACTORS[self.factor]


def counts_in(recorded: Recorded) -> Counts | None:
    """Return the axis whose angle, times one of the `FACTORS`, makes a recording fit the robot best.

    None where it fits already, or where a torque's scale, a number that is fitted, explains about as much.

    Parameters
    ----------
    recorded
        What was recorded, below the robot's first resonance.
    """
    before, n_axis = shares(recorded), recorded.drives.n_axis
    if not (before > NOTICED).any():
        return None
    worst = int(np.argmax(before))
    best = None
    for axis in range(n_axis):
        for factor in FACTORS:
            after = shares(recorded.undone(Slip("", "", _scaled(n_axis, axis, factor), np.eye(n_axis))))
            gain = explained(before, after)
            if mends(before, after) and (best is None or gain > best.explained):
                rms = float(np.sqrt(before[worst])), float(np.sqrt(after[worst]))
                best = Counts(axis, factor, *rms, gain)
    if best is None or best.explained < TIE + max(_by_torque(recorded, a) for a in range(n_axis)):
        return None
    return best


def explained_by(recorded: Recorded, slip: Slip) -> float:
    """Return the logarithm of what is left less without a slip, over all axes."""
    return explained(shares(recorded), shares(recorded.undone(slip)))


def _by_torque(recorded: Recorded, axis: int) -> float:
    """Return how much the scale of an axis' torque explains that suits it best."""
    factor, _ = recorded.scaled(axis)
    if factor <= 0:
        return 0.0
    n_axis = recorded.drives.n_axis
    return explained_by(recorded, Slip("", "", np.eye(n_axis), _scaled(n_axis, axis, 1 / factor)))


def _scaled(n_axis: int, axis: int, factor: float) -> FloatArray:
    scale = np.eye(n_axis)
    scale[axis, axis] = factor
    return scale
