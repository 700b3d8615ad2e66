"""One metric of error and one rule of coverage, for every claim of accuracy: pure functions on arrays.

Truth of a response is its best linear approximation; truth of a stiffness is the plant's. Errors of responses are
complex logarithms, so that amplitude (nepers) and phase (rad) count alike and all entries weigh the same; only
entries that the reference measurement of 24 experiments sees above 10 dB count. Regions of complex entries take
their degrees of freedom into account: F(2, 2 nu), nu = M - 1 from M blocks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

SIGNAL_TO_NOISE_DB = 10.0


# Error ------------------------------------------------------------------------------------------------------------


def seen_entries(response: ComplexArray, variance: FloatArray) -> BoolArray:
    """Entries of which ``|G|^2 / variance`` is above 10 dB, in the shape of the response.

    `variance` is that of the reference measurement, one mask for all methods that are compared.
    """
    seen: BoolArray = np.abs(response) ** 2 > 10 ** (SIGNAL_TO_NOISE_DB / 10) * variance
    return seen


def log_error(estimate: ComplexArray, truth: ComplexArray) -> ComplexArray:
    """``log G - log G_BLA``: real part in nepers, imaginary part in rad within -pi..pi."""
    result: ComplexArray = np.log(estimate / truth)
    return result


def rms_log_error(estimate: ComplexArray, truth: ComplexArray, seen: BoolArray) -> float:
    """Root mean square of ``|log G - log G_BLA|`` over lines, poses, seeds and seen entries.

    `truth` and `seen` broadcast against `estimate` (seeds in front). An estimate that is NaN, zero or infinite in
    a seen entry has no finite error: the result is infinite.
    """
    where = np.broadcast_to(seen, np.shape(estimate))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.abs(log_error(estimate, truth))[where]
    return float(np.sqrt(np.mean(np.where(np.isnan(error), np.inf, error) ** 2)))


def bias_and_scatter(estimate: ComplexArray, truth: ComplexArray, seen: BoolArray) -> tuple[float, float]:
    """Root mean square bias and scatter of log G over seeds, shape (n_seed, ...), n_seed >= 2.

    Unbiased: what the scatter of n_seed runs adds to the square of their mean error is taken off; a bias that is
    lost in it is zero.
    """
    where = np.broadcast_to(seen, np.shape(estimate)[1:])
    error = log_error(estimate, truth)[:, where]
    scatter = float(np.mean(error.var(axis=0, ddof=1)))
    bias = float(np.mean(np.abs(error.mean(axis=0)) ** 2)) - scatter / len(error)
    return float(np.sqrt(max(bias, 0.0))), float(np.sqrt(scatter))


def relative_error(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """``estimate / truth - 1``."""
    result: FloatArray = np.asarray(estimate / truth - 1)
    return result


def rms_relative_error(estimate: FloatArray, truth: FloatArray) -> float:
    """Root mean square of ``estimate / truth - 1`` over plants and parameters."""
    return float(np.sqrt(np.mean(relative_error(estimate, truth) ** 2)))


# Coverage ---------------------------------------------------------------------------------------------------------


def region_factor(degrees_of_freedom: npt.ArrayLike, level: float = 0.95) -> FloatArray:
    """Quantile of F(2, 2 nu): a region is ``|g - truth|^2 <= factor * variance``.

    `variance` is of real and imaginary part together, from nu complex degrees of freedom (M blocks: M - 1); 5.14
    at nu = 3, 3.00 at infinity.
    """
    freedom = np.asarray(degrees_of_freedom, dtype=np.float64)
    normal = -np.log1p(-level)
    with np.errstate(invalid="ignore"):
        factor = stats.f.ppf(level, 2, 2 * freedom)
    result: FloatArray = np.where(np.isinf(freedom), normal, factor)
    return result


def covered(
    estimate: ComplexArray,
    truth: ComplexArray,
    variance: FloatArray,
    degrees_of_freedom: npt.ArrayLike,
    *,
    truth_variance: npt.ArrayLike = 0.0,
    level: float = 0.95,
) -> BoolArray:
    """Tell which complex entries lie within their region about the estimate.

    Parameters
    ----------
    estimate, truth
        Broadcasting against one another.
    variance
        That the estimator states, of real and imaginary part together.
    degrees_of_freedom
        Behind that variance, complex.
    truth_variance
        Of the truth itself (G_BLA is an average too), added to `variance`; nothing where it is a hundredth of that.
    level
        Of the regions.
    """
    radius = region_factor(degrees_of_freedom, level) * (variance + np.asarray(truth_variance))
    inside: BoolArray = np.abs(estimate - truth) ** 2 <= radius
    return inside


def interval_covers(
    estimate: FloatArray, truth: FloatArray, standard_error: FloatArray, level: float = 0.95
) -> BoolArray:
    """Tell which real parameters lie within their interval; Gaussian, as the fits state it."""
    half = stats.norm.ppf(0.5 + level / 2) * standard_error
    inside: BoolArray = np.abs(estimate - truth) <= half
    return inside


@dataclass(frozen=True)
class Share:
    """A share of trials with its Wilson interval."""

    hits: int
    trials: int
    lower: float
    upper: float

    @property
    def value(self) -> float:
        """hits / trials."""
        return self.hits / self.trials


def share(hits: BoolArray, level: float = 0.95) -> Share:
    """Share of true values with its Wilson (1927) interval, which is right near 0 and 1 too.

    Trials are taken as independent: lines at least a window apart (`lines_apart`), other seeds, plants or poses.
    """
    n, k = hits.size, int(np.count_nonzero(hits))
    if n == 0:
        raise ValueError("a share of no trials: is every entry masked?")
    z = float(stats.norm.ppf(0.5 + level / 2))
    centre = (k + z**2 / 2) / (n + z**2)
    half = z / (n + z**2) * np.sqrt(k * (n - k) / n + z**2 / 4)
    return Share(k, n, max(0.0, float(centre - half)), min(1.0, float(centre + half)))


def lines_apart(n_freq: int, window: int) -> npt.NDArray[np.int64]:
    """Indices of lines that share no neighbour in a window of that many lines, in the middle of the band."""
    first = ((n_freq - 1) % max(window, 1)) // 2
    return np.arange(first, n_freq, max(window, 1))


def bootstrap_interval(
    values: FloatArray,
    statistic: Callable[[FloatArray], float],
    generator: np.random.Generator,
    *,
    draws: int = 1000,
    level: float = 0.95,
) -> tuple[float, float]:
    """Percentile interval of a statistic of `values` (n_unit, ...), units (poses or plants) drawn with replacement."""
    n = len(values)
    drawn = [statistic(values[generator.integers(n, size=n)]) for _ in range(draws)]
    lower, upper = np.quantile(drawn, [(1 - level) / 2, (1 + level) / 2])
    return float(lower), float(upper)
