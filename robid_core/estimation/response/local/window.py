"""Which lines take part in the local fit of a line, and where they stand relative to it.

Lines need not be evenly spaced: the local variable is the true offset in frequency, scaled to at most one. At
the ends of the band windows lean inward and keep their size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.response.local.model import LocalModel


@dataclass(frozen=True)
class Windows:
    """Lines `first` to `last` (included) around each line, each of shape (n_freq,).

    `half_width_hz` (n_freq,) is the largest distance of a line in the window from its centre.
    """

    frequency_hz: FloatArray
    first: IntArray
    last: IntArray
    half_width_hz: FloatArray

    @property
    def size(self) -> IntArray:
        """Lines in each window."""
        result: IntArray = self.last - self.first + 1
        return result

    def lines(self, chunk: slice = slice(None)) -> tuple[IntArray, BoolArray]:
        """Indices of the lines of some windows, and which of them count, each (n, largest size).

        Windows of different size are filled up with lines that do not count.
        """
        first, last = self.first[chunk], self.last[chunk]
        index = first[:, None] + np.arange((last - first).max() + 1)
        counts: BoolArray = index <= last[:, None]
        return np.minimum(index, last[:, None]), counts

    def offset(self, chunk: slice = slice(None)) -> FloatArray:
        """Return the local variable of `lines`, between -1 and 1: frequency less the centre's over the half width."""
        index, _ = self.lines(chunk)
        away = self.frequency_hz[index] - self.frequency_hz[chunk, None]
        result: FloatArray = away / self.half_width_hz[chunk, None]
        return result


def windows_of_lines(frequency_hz: FloatArray, n_line: int) -> Windows:
    """As many lines below as above, the odd one below (thesis, after eq. 3.16)."""
    n_freq = len(frequency_hz)
    first = np.clip(np.arange(n_freq) - n_line // 2, 0, n_freq - n_line)
    return _windows(frequency_hz, first, first + n_line - 1)


def windows_of_width(frequency_hz: FloatArray, width_hz: float) -> Windows:
    """All lines of a band `width_hz` wide, centred but for the ends, where it leans inward."""
    low = np.minimum(frequency_hz - 0.5 * width_hz, frequency_hz[-1] - width_hz)
    low = np.maximum(low, frequency_hz[0])
    slack = 1e-9 * frequency_hz[-1]  # a line on the edge of a band belongs to it, whatever the rounding
    first = np.searchsorted(frequency_hz, low - slack, side="left")
    last = np.searchsorted(frequency_hz, low + width_hz + slack, side="right") - 1
    return _windows(frequency_hz, first, last)


def _windows(frequency_hz: FloatArray, first: IntArray, last: IntArray) -> Windows:
    away = np.maximum(frequency_hz - frequency_hz[first], frequency_hz[last] - frequency_hz)
    return Windows(frequency_hz, first.astype(np.int64), last.astype(np.int64), np.where(away > 0, away, 1.0))


def choose_windows(
    frequency_hz: FloatArray,
    model: LocalModel,
    n_in: int,
    n_out: int,
    n_exp: int,
    *,
    window_lines: int | None = None,
    window_hz: float | None = None,
    n_stated: int | None = None,
) -> Windows:
    """Windows of given size, or of the smallest that leaves enough degrees of freedom.

    Parameters
    ----------
    frequency_hz
        Lines, increasing, shape (n_freq,).
    model, n_in, n_out, n_exp
        What is fitted, and from how many experiments.
    window_lines, window_hz
        Size in lines or in hertz; with neither, `LocalModel.comfortable_window`, or the whole band where that
        has fewer lines.
    n_stated
        Outputs whose covariance will be stated; all by default.

    Raises
    ------
    ConfigurationError
        If both sizes are given, or a window has fewer lines than the unknowns need.
    DataRejected
        If the whole band has fewer.
    """
    n_freq = len(frequency_hz)
    if window_lines is not None and window_hz is not None:
        raise ConfigurationError("window_lines and window_hz are both given; a window has one size: drop one")
    needed = model.smallest_window(n_in, n_out, n_exp)
    unknowns = model.unknowns(n_in, n_out)
    words = f"{unknowns:.3g} unknowns per output" + (
        f" and {model.transient_terms} per experiment" if model.transient_terms else ""
    )
    if n_freq < needed:
        enough = model.experiments_for(n_freq, n_in, n_out)
        raise DataRejected(
            f"fewer lines than unknowns: {words} need a window of {needed} lines with {n_exp} "
            f"experiment{'s' if n_exp > 1 else ''} of {n_in} inputs, and the whole band has {n_freq}; "
            + (f"measure {enough} experiments, " if enough else "")
            + "excite more lines, or lower the orders"
        )
    if window_hz is not None:
        windows = windows_of_width(frequency_hz, window_hz)
    else:
        size = window_lines or min(n_freq, model.comfortable_window(n_in, n_out, n_exp, n_stated))
        windows = windows_of_lines(frequency_hz, min(size, n_freq))
    short = np.flatnonzero(windows.size < needed)
    if len(short):
        line = int(short[np.argmin(windows.size[short])])
        size = int(windows.size[line])
        enough = model.experiments_for(size, n_in, n_out)
        raise ConfigurationError(
            f"fewer lines than unknowns: the window around {frequency_hz[line]:.4g} Hz has {size} lines, and {words} "
            f"need {needed} with {n_exp} experiment{'s' if n_exp > 1 else ''} of {n_in} inputs; widen it"
            + (f", measure {enough} experiments" if enough else "")
            + ", or lower the orders"
        )
    return windows
