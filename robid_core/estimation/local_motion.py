"""Angle, speed and acceleration at chosen samples of a recorded motion, from parabolas through the samples around."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import FloatArray


def local_motion(
    position: FloatArray, samples: Sequence[int], half_window: int, sample_time: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angle, speed and acceleration at some samples, by least squares.

    White noise of standard deviation s leaves ``s / (T sqrt(m (m + 1) (2 m + 1) / 3))`` in the speed, with m the half
    window; at the ends of a recording the window has samples on one side only, and leaves more.

    Parameters
    ----------
    position
        Recorded angles, rad, shape (n_lane, n_sample, n_axis), at least three samples.
    samples
        Where the motion is wanted.
    half_window
        Samples on either side that count, at least one.
    sample_time
        T, s.

    Returns
    -------
    Angle in rad, speed in rad/s and acceleration in rad/s^2, each (n_lane, len(samples), n_axis).
    """
    n_sample = position.shape[1]
    found = np.empty((3, len(position), len(samples), position.shape[2]))
    for k, sample in enumerate(samples):
        first = min(max(sample - half_window, 0), n_sample - 3)
        last = max(min(sample + half_window + 1, n_sample), first + 3)
        time = (np.arange(first, last) - sample) * sample_time
        powers = np.stack((np.ones_like(time), time, time**2 / 2), axis=1)
        found[:, :, k] = np.einsum("pn,lna->pla", np.linalg.pinv(powers), position[:, first:last])
    return found[0], found[1], found[2]
