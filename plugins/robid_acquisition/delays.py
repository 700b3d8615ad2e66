"""Channels that were reported late, moved back by any part of a sample.

What repeats is moved exactly, by its Fourier series. Anything else is interpolated by a sinc under a Kaiser window of
64 samples: of a sine below 0.8 of the Nyquist frequency an error of at most 1e-5 is left. Samples whose window passes
an end, or a hole, are lost.
"""

from __future__ import annotations

import numpy as np

from robid_core import BoolArray, FloatArray

REACH = 32  # samples on either side
KAISER = 12.0


def moved_back_periodic(values: FloatArray, delay: FloatArray) -> FloatArray:
    """Return whole periods as they were `delay` samples earlier, exact below the Nyquist frequency.

    Parameters
    ----------
    values
        Whole periods one after another, (n_sample, n_axis); the first follows on the last.
    delay
        In samples, (n_axis,).
    """
    n = len(values)
    spectrum = np.fft.rfft(values, axis=0)
    turns = np.arange(len(spectrum))[:, None] * delay / n
    turned = spectrum * np.exp(2j * np.pi * turns)
    if n % 2 == 0:  # of what lies at the Nyquist frequency only the cosine is known
        turned[-1] = spectrum[-1].real * np.cos(np.pi * delay)
    return np.fft.irfft(turned, n, axis=0)


def moved_back(values: FloatArray, delay: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return samples as they were `delay` samples earlier, and which of them are known, (n_sample,).

    Parameters
    ----------
    values
        Shape (n_sample, n_axis), NaN in holes; an axis without any value is left as it is.
    delay
        In samples, (n_axis,); whole ones are a plain shift.
    """
    result, known = np.full_like(values, np.nan), np.ones(len(values), dtype=bool)
    for axis, late in enumerate(delay):
        column = values[:, axis]
        if np.isnan(column).all():
            continue
        whole = int(np.floor(late + 1e-9))
        part = late - whole
        if abs(part) < 1e-9:
            offsets, weights = np.array([whole]), np.ones(1)
        else:
            offsets = whole + np.arange(1 - REACH, REACH + 1)
            weights = kernel(late - offsets)
            weights /= weights.sum()
        index = np.arange(len(values))
        inside = (index + offsets[0] >= 0) & (index + offsets[-1] < len(values))
        rows = index[inside]
        if len(rows):
            windows = np.lib.stride_tricks.sliding_window_view(column, len(offsets))
            result[rows, axis] = windows[rows + offsets[0]] @ weights
        known &= np.isfinite(result[:, axis])
    return result, known


def kernel(distance: FloatArray, reach: int = REACH) -> FloatArray:
    """Sinc under a Kaiser window, at distances in samples; 0 beyond `reach`."""
    share = np.clip(1 - (distance / reach) ** 2, 0.0, None)
    window = np.where(np.abs(distance) <= reach, np.i0(KAISER * np.sqrt(share)) / np.i0(KAISER), 0.0)
    result: FloatArray = np.sinc(distance) * window
    return result
