"""Channels that were reported late, moved back by any part of a sample; of values that were held, the mean over it.

What repeats is moved exactly, by its Fourier series. Anything else is interpolated by a sinc under a Kaiser window of
64 samples: of a sine below 0.8 of the Nyquist frequency an error of at most 1e-5 is left. Samples whose window passes
an end, or a hole, are lost.
"""

from __future__ import annotations

import numpy as np

from robid_core import BoolArray, FloatArray

REACH = 32  # samples on either side
KAISER = 12.0
INSTANTS, SHARES = np.polynomial.legendre.leggauss(8)  # of a mean over what was held


def moved_back_periodic(values: FloatArray, delay: FloatArray, held: float = 0.0) -> FloatArray:
    """Return whole periods as they were `delay` samples earlier, exact below the Nyquist frequency.

    Parameters
    ----------
    values
        Whole periods one after another, (n_sample, n_axis); the first follows on the last.
    delay
        In samples, (n_axis,).
    held
        Samples, or a part of one, for which each value went on: the mean over so long before is what acted.
    """
    n, early = len(values), delay - held / 2
    spectrum = np.fft.rfft(values, axis=0)
    turns = np.arange(len(spectrum))[:, None] / n
    turned = spectrum * np.sinc(turns * held) * np.exp(2j * np.pi * turns * early)
    if n % 2 == 0:  # of what lies at the Nyquist frequency only the cosine is known
        turned[-1] = spectrum[-1].real * np.sinc(held / 2) * np.cos(np.pi * early)
    return np.fft.irfft(turned, n, axis=0)


def moved_back(values: FloatArray, delay: FloatArray, held: float = 0.0) -> tuple[FloatArray, BoolArray]:
    """Return samples as they were `delay` samples earlier, and which of them are known, (n_sample,).

    Parameters
    ----------
    values
        Shape (n_sample, n_axis), NaN in holes; an axis without any value is left as it is.
    delay
        In samples, (n_axis,); whole ones are a plain shift.
    held
        As of `moved_back_periodic`.
    """
    result, known = np.full_like(values, np.nan), np.ones(len(values), dtype=bool)
    for axis, late in enumerate(delay):
        column = values[:, axis]
        if np.isnan(column).all():
            continue
        early = late - held / 2
        whole = int(np.floor(early + 1e-9))
        part = early - whole
        if abs(part) < 1e-9 and not held:
            offsets, weights = np.array([whole]), np.ones(1)
        else:
            offsets = whole + np.arange(1 - REACH, REACH + 1)
            instants = early + 0.5 * held * INSTANTS[:, None]
            weights = SHARES @ kernel(instants - offsets) if held else kernel(early - offsets)
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
