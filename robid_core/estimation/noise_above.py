"""White noise of measured angles by what a low-pass takes off them: above all motion there is nothing else."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray

MEDIAN = 0.455  # of a chi square with one degree of freedom


def density_above(above: FloatArray, sample_time: float, cutoff_hz: float) -> FloatArray:
    """Spectral density of white noise, rad^2/Hz, (n_axis,), of which all `above` an edge is known, (n_sample, n_axis).

    By the median, so that moments at which more than noise is left do not count.
    """
    density: FloatArray = np.median(above**2, axis=0) / MEDIAN / (0.5 / sample_time - cutoff_hz)
    return density
