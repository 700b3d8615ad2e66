"""White noise of measured angles, as the top of their spectrum shows it where nothing moves.

A motion that does not repeat cannot be compared with itself. But what moves a motor falls with the cube of the
frequency or faster (a step of torque), and noise and steps of an encoder do not: where two bands below half the
sampling rate hold equal power, that is noise.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core.arrays import FloatArray

LOWER, UPPER = (0.7, 0.8), (0.9, 1.0)  # of half the sampling rate: two bands
WHITE = 1.5  # times the power of the upper band, or less in the lower one; of steps of torque it is 2.8 with aliases
ABOVE = 1.2  # times the highest frequency of a fit: from there on nothing is excited
FEWEST = 20  # bins in a band
MORE = 2.0  # times a variance that is known otherwise: angles that show more are believed


def shown_noise(angle: FloatArray, sample_time_s: float, highest_hz: float) -> FloatArray:
    """Variance of a white noise at each sample, rad^2, (n_axis,); zero where the spectrum does not show any.

    Parameters
    ----------
    angle
        rad, (n_config, n_exp, n_sample, n_axis).
    highest_hz
        Up to which motions are looked at.
    """
    n, n_axis = angle.shape[2:]
    lower, upper = (slice(*(int(share * (n // 2)) for share in band)) for band in (LOWER, UPPER))
    if lower.start / (n * sample_time_s) < ABOVE * highest_hz or lower.stop - lower.start < FEWEST:
        return np.zeros(n_axis)
    share = np.linspace(0.0, 1.0, n)[:, None]
    straight = angle[:, :, :1] + share * (angle[:, :, -1:] - angle[:, :, :1])
    window = np.hanning(n)[:, None] ** 2  # its side lobes fall with the fifth power of the distance
    spectrum = scipy.fft.rfft((angle - straight) * window, axis=2)
    power = (np.abs(spectrum) ** 2).mean(axis=(0, 1)) / (window**2).sum()
    variance: FloatArray = power[upper].mean(axis=0)
    return np.where(power[lower].mean(axis=0) <= WHITE * variance, variance, 0.0)
