"""How much better a recording fits the robot once a mistake in it is mended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.rigid.plausibility import GAIN, LEFT, NOTICED, SPOILS, Recorded

MODEL = 1e-3  # of a torque's power: less that is left is no better


@dataclass(frozen=True)
class Mended:
    """Axes of which a recording has a mistake, and what mending it explains."""

    axes: tuple[int, ...]
    before: float
    """Share of the torque that the robot leaves, rms, at the axis that it leaves most of; as recorded."""
    after: float
    """Likewise, once it is mended."""
    explained: float
    """Logarithm of what is left less, over all axes."""

    @classmethod
    def of_shares(cls, axes: tuple[int, ...], before: FloatArray, after: FloatArray) -> Mended:
        """From the shares of each torque's variance that are left, (n_axis,) each."""
        worst = int(np.argmax(before))
        rms = float(np.sqrt(before[worst])), float(np.sqrt(after[worst]))
        return cls(axes, *rms, explained(before, after))


def mends(before: FloatArray, after: FloatArray) -> bool:
    """Whether a change makes torques fit that did not, and spoils no other; shares that are left, (n_axis,) each."""
    wrong = before > NOTICED
    if not wrong.any():
        return False
    gain = np.log(np.maximum(before, MODEL) / np.maximum(after, MODEL))
    spoiled = (after[~wrong] > np.maximum(SPOILS * before[~wrong], NOTICED)).any()
    return bool(np.median(gain[wrong]) > np.log(GAIN) and np.median(after[wrong]) < LEFT and not spoiled)


def explained(before: FloatArray, after: FloatArray) -> float:
    """Return the logarithm of what is left less, over all axes."""
    return float(np.log(np.maximum(before, MODEL) / np.maximum(after, MODEL)).sum())


def shares(recorded: Recorded) -> FloatArray:
    """Share of each torque's power that the robot leaves with the friction that suits it best, (n_axis,)."""
    rest = recorded.torque - recorded.rigid - recorded.drives.offset
    return np.array([recorded.beside_friction(axis, rest[:, axis])[1] for axis in range(len(rest.T))])
