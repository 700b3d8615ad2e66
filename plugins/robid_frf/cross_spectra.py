"""Responses of all lines from the columns of cross spectra, and the covariance their residuals give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from robid_core import BoolArray, ComplexArray, DataRejected, FloatArray, IntArray
from robid_core.estimation.response.covariance import default_half_window, pool_lines
from robid_core.estimation.response.instrumental import multiple_coherence, response_of_periods
from robid_core.estimation.response.welch import Correlation, pooled_freedom, refuse_few_segments
from robid_frf.segments import Columns, Cut

Instruments = tuple[Literal["reference", "other_period"], ...]


def instruments(columns: Columns, names: Instruments) -> ComplexArray | None:
    """Stack instruments along the axes: the reference, or the mean input of all *other* periods.

    The noise of other periods is independent of this one's, so that noise on the measured torque does no harm;
    the distortion of a nonlinear robot repeats and is not told apart. None where the inputs are to be their own.
    """
    stacked = []
    for name in names:
        if name == "reference" and columns.r is not None:
            stacked.append(columns.r)
        elif name == "other_period":
            n_period = columns.u.shape[-1]
            if n_period < 2:
                raise DataRejected(
                    f"instruments: {n_period} period is kept and other_period needs two; measure more, or take the "
                    "reference"
                )
            stacked.append((columns.u.sum(axis=-1, keepdims=True) - columns.u) / (n_period - 1))
    return np.concatenate(stacked, axis=1) if stacked else None


def _lines(spectra: ComplexArray, index: IntArray) -> ComplexArray:
    """Bins of each line side by side: (n_line, n_axis, n_exp * n_segment * n_bin, n_period); index (n_line, n_bin)."""
    chosen = np.moveaxis(spectra[index], 1, 4)
    return chosen.reshape(*chosen.shape[:2], -1, chosen.shape[-1])


@dataclass(frozen=True)
class Estimated:
    """Estimates of all lines of one configuration; first axis n_freq.

    Residual products of expectation `weight` times C_V with `freedom` degrees of freedom, and the same for the
    noise (`noise_weight` 0: a single period); `reference_ratio` as `reference_ratio` gives it.
    """

    response: ComplexArray
    gram_inverse: ComplexArray
    products: ComplexArray
    weight: FloatArray
    freedom: FloatArray
    noise_products: ComplexArray
    noise_weight: FloatArray
    noise_freedom: FloatArray
    power: FloatArray
    reference_ratio: FloatArray

    @classmethod
    def empty(cls, n_freq: int, n_axis: int) -> Self:
        """Room for the results."""
        matrices = [np.full((n_freq, n_axis, n_axis), np.nan + 0j) for _ in range(4)]
        numbers = [np.zeros(n_freq) for _ in range(4)]
        return cls(
            matrices[0], matrices[1], matrices[2], numbers[0], numbers[1], matrices[3], numbers[2], numbers[3],
            np.zeros((n_freq, n_axis)), np.full(n_freq, np.nan),
        )  # fmt: skip


def reference_ratio(r: ComplexArray, u: ComplexArray) -> FloatArray:
    """Power of the response from reference to inputs over its variance, the worst axis, shape (n_line,).

    The ratio of two noisy responses is biased by about exp(-ratio) (Guillaume, Kollar and Pintelon 1996, for
    circular noise): the joint input-output approach has the best linear approximation as its mean where the ratio
    is large.
    """
    n_column, n_reference = u.shape[-2], r.shape[1]
    unexplained = np.maximum(1 - multiple_coherence(r.mean(axis=-1), u.mean(axis=-1)), 0)
    # Of n_column samples n_reference are explained in any case.
    unexplained = np.minimum(unexplained * n_column / max(n_column - n_reference, 1), 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: FloatArray = (n_column / n_reference * (1 - unexplained) / unexplained).min(axis=-1)
    return ratio


def estimate_lines(
    columns: Columns,
    groups: list[IntArray],
    cut: Cut | None,
    names: Instruments,
    condition_limit: float,
    what: str,
) -> Estimated:
    """Estimate line by line; lines that average over equally many bins go together.

    `groups` holds the bins of each line, counted from zero where there is no cut. `what` begins the message of
    the PoorExcitation that is raised where a line has fewer independent columns than there are axes.
    """
    z = instruments(columns, names)
    sizes = np.array([len(group) for group in groups])
    n_period = columns.u.shape[-1]
    result = Estimated.empty(len(groups), columns.u.shape[1])
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        bins = np.array([groups[k] for k in which])
        index = bins if cut is None else bins - cut.bins[0]
        u, y = _lines(columns.u, index), _lines(columns.y, index)
        related = Correlation(None if cut is None else cut.segments, bins, columns.kept)
        trace, square = related.traces()
        refuse_few_segments(trace**2 / square, u.shape[1], what)
        lines = None if z is None else _lines(z, index)
        found = response_of_periods(u, y, lines, related.correlate, trace, square, condition_limit)
        result.response[which] = found.response
        result.gram_inverse[which] = found.scatter.gram_inverse
        result.products[which] = found.scatter.products
        result.weight[which] = found.scatter.weight
        result.freedom[which] = found.scatter.degrees_of_freedom
        result.power[which] = found.power
        if found.noise_products is not None:
            result.noise_products[which] = found.noise_products
            result.noise_weight[which] = (n_period - 1) * trace
            result.noise_freedom[which] = (n_period - 1) * trace**2 / square
        if names == ("reference",) and columns.r is not None:
            result.reference_ratio[which] = reference_ratio(_lines(columns.r, index), u)
    return result


@dataclass(frozen=True)
class Stated:
    """Stated covariance over all configurations with its degrees of freedom, and the lines that share it."""

    covariance: ComplexArray
    degrees_of_freedom: FloatArray
    lines: int


def row_sizes(response: ComplexArray) -> ComplexArray:
    """Diagonal matrices of the responses' row norms, averaged with the neighbours' in power, weights 1, 2, 1.

    Only to tell how residuals go with frequency. From few segments in much noise the inverse of a response that is
    nearly singular by its own errors would decide that, and the covariance had a scatter far beyond its degrees of
    freedom; norms of rows have no inverse, and windowed segments are smooth over this width anyway. Takes and returns
    shape (n_config, n_freq, n, n); NaN stays.
    """
    power = np.sum(np.abs(response) ** 2, axis=-1)
    padded = np.concatenate([power[:, :1], power, power[:, -1:]], axis=1)
    mean = 0.25 * padded[:, :-2] + 0.5 * power + 0.25 * padded[:, 2:]
    norm = np.sqrt(np.where(np.isfinite(mean), mean, power))
    result: ComplexArray = norm[..., None] * np.eye(response.shape[-1], dtype=np.complex128)
    return result


def state(
    products: ComplexArray,
    weight: FloatArray,
    freedom: FloatArray,
    valid: BoolArray,
    estimated: list[Estimated],
    frequency_hz: FloatArray,
    groups: list[IntArray],
    cut: Cut | None,
    half_window: int | None,
) -> Stated | None:
    """Covariance of a column, from neighbouring lines where one line's degrees of freedom are too few.

    Returns None where there are none to be had. Shapes (n_config, n_freq, ...).
    """
    n_out = products.shape[-1]
    if not valid.any() or not (weight[valid] > 0).all():
        return None
    least = float(freedom[valid].min())
    if half_window is None:
        # Four times as many as outputs: the inverse covariance is a third too large then (`default_half_window`).
        half_window = 0 if least >= 4 * n_out else default_half_window(max(1, round(least)), n_out)
    common = max(1, int(weight[valid].min()))
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = products * np.where(valid, common / weight, 0)[..., None, None]
    power = np.stack([one.power for one in estimated])
    response = np.stack([one.response for one in estimated])
    if cut is not None:
        response = row_sizes(response)
    pooled = pool_lines(scaled, common, valid, power, response, frequency_hz, half_window)
    if pooled is None:
        return None
    window = None if cut is None else cut.segments.window
    degrees = pooled_freedom(freedom, valid, half_window, groups, window)
    return Stated(pooled.covariance, degrees, 2 * half_window + 1)
