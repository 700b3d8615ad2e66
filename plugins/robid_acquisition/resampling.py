"""Unevenly sampled channels on an even grid, and the error that this brings.

Linear interpolation, cubic splines, or band-limited: the even samples whose interpolation by a windowed sinc
(`delays.kernel`) meets the uneven ones best. The error of the first two is estimated from the data: every second
sample is interpolated from the others and compared, and the rms difference is brought to the spacing of the grid by the
order of the method, h1 h2 / 2 |f''| (linear) or (h1 h2)^2 / 24 |f''''| (cubic), with h1 and h2 the distances to the
neighbours. Steps and noise do not fall with that order: where the difference at half and at a quarter of the samples
shows a lower one, that one is taken; what lies above half the Nyquist frequency makes the estimate too large. The error
of the band-limited one is its difference to a window of half the length, which is at least as large.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

import numpy as np
import scipy

from robid_acquisition.delays import REACH, kernel
from robid_acquisition.time_stamps import GAP
from robid_core import BoolArray, DataRejected, FloatArray

Method = Literal["linear", "cubic", "band_limited"]
POWER = {"linear": 1, "cubic": 2}  # of h1 h2 in the error
LEAST = {"linear": 9, "cubic": 16, "band_limited": 4 * REACH}  # rows of a piece
RIDGE = 1e-9  # of the mean square of a row: what the rows do not tell stays small


def on_even_grid(
    tables: dict[str, FloatArray],
    known: BoolArray,
    time: FloatArray,
    sample_time_s: float,
    method: Method,
    held: Collection[str] = (),
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return channels on the grid that begins at the first row, NaN where they are not known, and their errors.

    Parameters
    ----------
    tables
        Channels, each (n_row, n_column).
    known
        Rows that may be used, (n_row,); nothing is interpolated across others, nor across gaps in time.
    time
        Of the rows, s, running forward.
    sample_time_s
        Spacing of the grid.
    method
        How.
    held
        Channels whose values hold until the next one; they have no error.

    Returns
    -------
    Values, each (n_grid, n_column), and rms errors, each (n_column,), in the channel's unit.

    Raises
    ------
    DataRejected
        If the grid is wider than the recording's own spacing: what lies above its Nyquist frequency would be folded. If
        it is narrower, where the band-limited method would have more unknowns than samples.
    """
    usual = float(np.median(np.diff(time)))
    if sample_time_s > 1.2 * usual:
        raise DataRejected(
            f"resample: sample_time_s {sample_time_s:g} is longer than the recording's own {usual:g} s, which would "
            "fold what is fast; leave it out, or give a shorter one"
        )
    if method == "band_limited" and sample_time_s < 0.9999 * _mean_step(time, usual):
        raise DataRejected(
            f"resample: sample_time_s {sample_time_s:g} is shorter than the recording's own "
            f"{_mean_step(time, usual):.6g} s, more samples than band_limited can give; leave it out, or take cubic"
        )
    n_grid = int(np.floor((time[-1] - time[0]) / sample_time_s + 1e-6)) + 1
    grid = time[0] + sample_time_s * np.arange(n_grid)
    values = {name: np.full((n_grid, table.shape[1]), np.nan) for name, table in tables.items()}
    squares = {name: np.zeros(table.shape[1]) for name, table in tables.items()}
    n_used = 0
    for rows in _pieces(known, time, usual):
        if rows.stop - rows.start < LEAST[method]:
            continue
        own = time[rows]
        inside = np.flatnonzero((grid >= own[0] - 1e-9 * usual) & (grid <= own[-1] + 1e-9 * usual))
        for name, table in tables.items():
            if name in held:
                last = np.searchsorted(own, grid[inside] + 1e-9 * usual, side="right") - 1
                piece, error = table[rows][last], np.zeros(table.shape[1])
            elif method == "band_limited":
                piece, error = _band_limited(own, table[rows], grid[inside], sample_time_s)
            else:
                piece = _interpolated(own, table[rows], grid[inside], method)
                error = _mean_square_error(own, table[rows], grid[inside], method)
            values[name][inside] = piece
            squares[name] += len(inside) * error
        n_used += len(inside)
    return values, {name: np.sqrt(one / max(n_used, 1)) for name, one in squares.items()}


def _mean_step(time: FloatArray, usual: float) -> float:
    steps = np.diff(time)
    return float(steps[steps <= GAP * usual].mean())


def _pieces(known: BoolArray, time: FloatArray, usual: float) -> list[slice]:
    """Rows without a hole or a gap."""
    joined = known[1:] & known[:-1] & (np.diff(time) <= GAP * usual)
    cuts = np.flatnonzero(~joined) + 1
    return [slice(a, b) for a, b in zip([0, *cuts], [*cuts, len(time)], strict=True)]


def _interpolated(time: FloatArray, values: FloatArray, wanted: FloatArray, method: str) -> FloatArray:
    if method == "linear":
        return np.stack([np.interp(wanted, time, one) for one in values.T], axis=1)
    result: FloatArray = scipy.interpolate.CubicSpline(time, values)(wanted)
    return result


def _mean_square_error(time: FloatArray, values: FloatArray, grid: FloatArray, method: str) -> FloatArray:
    """Mean square error of the values on the grid, (n_column,)."""
    squares, products = zip(*(_left_out(time, values, apart, method) for apart in (2, 4)), strict=True)
    after = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
    narrow = np.abs((grid - time[after - 1]) * (time[after] - grid))
    growth = np.log(np.maximum(squares[1], 1e-300) / np.maximum(squares[0], 1e-300))
    seen = growth / (2 * np.log(products[1].mean() / products[0].mean()))
    result = np.empty(values.shape[1])
    for k, order in enumerate(np.clip(seen, 0.0, POWER[method])):
        result[k] = squares[0][k] * (narrow ** (2 * order)).mean() / (products[0] ** (2 * order)).mean()
    return result


def _left_out(time: FloatArray, values: FloatArray, apart: int, method: str) -> tuple[FloatArray, FloatArray]:
    """Interpolate samples half way between every so many: mean square differences, and h1 h2 of each."""
    kept = np.arange(0, len(time), apart)
    asked = kept[:-1] + apart // 2
    difference = _interpolated(time[kept], values[kept], time[asked], method) - values[asked]
    product = (time[asked] - time[kept[:-1]]) * (time[kept[1:]] - time[asked])
    return (difference**2).mean(axis=0), product


def _band_limited(
    time: FloatArray, values: FloatArray, grid: FloatArray, sample_time_s: float
) -> tuple[FloatArray, FloatArray]:
    """Values on the grid, NaN near the ends, and their mean square error."""
    line = np.stack([np.ones_like(time), time - time[0]], axis=1)
    trend = np.linalg.lstsq(line, values, rcond=None)[0]
    rest = values - line @ trend
    found = [_even_samples(time, rest, grid, sample_time_s, reach) for reach in (REACH, REACH // 2)]
    error = ((found[0] - found[1])[REACH:-REACH] ** 2).mean(axis=0)
    result = found[0] + np.stack([np.ones_like(grid), grid - time[0]], axis=1) @ trend
    result[:REACH], result[-REACH:] = np.nan, np.nan
    return result, error


def _even_samples(
    time: FloatArray, values: FloatArray, grid: FloatArray, sample_time_s: float, reach: int
) -> FloatArray:
    """Even samples whose interpolation is nearest to uneven ones, by least squares."""
    n_unknown = len(grid) + 2 * reach  # those beyond the ends, too
    place = (time - grid[0]) / sample_time_s + reach
    first = np.floor(place).astype(np.int64) - reach + 1
    index = first[:, None] + np.arange(2 * reach)
    weights = kernel(place[:, None] - index, reach)
    inside = (index >= 0) & (index < n_unknown)
    rows = np.broadcast_to(np.arange(len(time))[:, None], index.shape)
    matrix = scipy.sparse.csr_array(
        (weights[inside], (rows[inside], index[inside])), shape=(len(time), n_unknown)
    )
    gram = (matrix.T @ matrix).tocoo()
    width = 2 * reach - 1
    banded = np.zeros((width + 1, n_unknown))
    upper = gram.col >= gram.row
    banded[width - (gram.col - gram.row)[upper], gram.col[upper]] = gram.data[upper]
    banded[width] += RIDGE * banded[width].mean()
    solved = scipy.linalg.solveh_banded(banded, matrix.T @ values)
    result: FloatArray = solved[reach:-reach]
    return result
