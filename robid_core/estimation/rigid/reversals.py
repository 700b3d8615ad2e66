"""Coulomb friction below a cutoff, of motors that reverse above it.

Friction follows the sign of the speed at every instant. A fast motion on a slow one reverses the motor many times, and
what is left of friction below a cutoff is the mean over these reversals: smaller than, and of another shape than, the
friction of the slow speed (dither). So the sign is taken first, and smoothed then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.rigid.friction_direction import direction
from robid_core.estimation.rigid.regression import differentiate, smooth

FAST = 0.1  # of the sampling rate: reversals above are noise of the angle


@dataclass(frozen=True, eq=False)
class Reversals:
    """Speeds of whole experiments with all their reversals, rad/s, (n_sample, n_axis) each."""

    speeds: tuple[FloatArray, ...]
    sample_time: float
    cutoff_hz: float
    kept: tuple[slice, ...]
    """Samples that are looked at, of each experiment."""
    every: int = 1
    """Of these."""

    @classmethod
    def of_angles(
        cls, angles: list[FloatArray], sample_time: float, cutoff_hz: float, kept: list[slice]
    ) -> Reversals:
        """Differentiate motor angles, rad, (n_sample, n_axis) each."""
        highest = max(FAST / sample_time, cutoff_hz)
        speeds = (differentiate(smooth(one, sample_time, highest), sample_time) for one in angles)
        return cls(tuple(speeds), sample_time, cutoff_hz, tuple(kept))

    def through(self, matrix: FloatArray) -> Reversals:
        """Return the reversals of motors whose angles are those times a matrix, (n_axis, n_axis)."""
        return replace(self, speeds=tuple(one @ matrix.T for one in self.speeds))

    def direction(self, friction_speed: FloatArray) -> FloatArray:
        """Return Coulomb friction over its size below the cutoff, where samples are looked at, (n_kept, n_axis).

        Parameters
        ----------
        friction_speed
            v_s of tanh(v / v_s), rad/s, (n_axis,); 0: plain sign(v).
        """
        parts = []
        for speed, kept in zip(self.speeds, self.kept, strict=True):
            sign = direction(speed, friction_speed)
            parts.append(smooth(sign, self.sample_time, self.cutoff_hz)[kept])
        return np.concatenate(parts)[:: self.every]
