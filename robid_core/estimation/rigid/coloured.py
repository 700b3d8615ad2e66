"""Regression with coloured residuals: how much less they tell than white ones, and the covariance of estimates.

Residuals of a real machine are what its model lacks, filtered by its motion: one sample resembles the next. Then
least squares still estimate, but the usual covariance is too small. Here the long-run variance is estimated with
Bartlett's kernel (Newey and West 1987), its bandwidth by the correlation from sample to sample (Andrews 1991).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.scaled_inverse import scaled_inverse

LARGEST_CORRELATION = 0.99  # from sample to sample: beyond, a record is too short to tell it
SHORTEST = 8  # bandwidths in a record, at least
FEWEST_INDEPENDENT = 30.0  # samples of a record: with fewer, intervals of slow parameters hold too seldom
MOST_FOR_FREEDOM = 4.0  # times a covariance: residuals are smaller by what was fitted to them


def correlation(residual: FloatArray) -> FloatArray:
    """Correlation from sample to sample, (n_axis,), of residuals about their mean, (n_sample, n_axis)."""
    left = residual - residual.mean(axis=0)
    power = (left**2).sum(axis=0)
    result: FloatArray = (left[1:] * left[:-1]).sum(axis=0) / np.where(power > 0, power, 1.0)
    return np.clip(result, -LARGEST_CORRELATION, LARGEST_CORRELATION)


def bandwidth(residual: FloatArray) -> int:
    """Samples over which residuals (n_sample, n_axis) are correlated: Andrews' rule for the most coloured axis."""
    n_sample = len(residual)
    rho = float(np.abs(correlation(residual)).max())
    shape = 4 * rho**2 / (1 - rho**2) ** 2
    length = int(np.rint(1.1447 * np.cbrt(shape * n_sample)))
    return max(1, min(length, n_sample // SHORTEST))


def is_counted(residuals: Sequence[FloatArray]) -> bool:
    """Whether a record is long enough to tell how coloured its residuals are, so that intervals can count it.

    Of an autoregression, nominal intervals of 95 % held 84 to 96 % of the truths where the record was worth 30
    independent samples and its memory was shorter than the longest bandwidth, and down to 43 % elsewhere.

    Parameters
    ----------
    residuals
        Of each experiment, (n_sample, n_axis).
    """
    lengths = [bandwidth(one) for one in residuals]
    independent = np.sum(
        [len(one) / inflation(one, length) for one, length in zip(residuals, lengths, strict=True)], axis=0
    )
    told = sum(len(one) for one, n in zip(residuals, lengths, strict=True) if n < len(one) // SHORTEST)
    return bool(independent.min() >= FEWEST_INDEPENDENT and told >= 0.5 * sum(len(one) for one in residuals))


def inflation(residual: FloatArray, length: int) -> FloatArray:
    """Long-run variance over variance, (n_axis,), one at least: so many samples tell as much as one of white noise.

    Parameters
    ----------
    residual
        Shape (n_sample, n_axis), of one experiment.
    length
        Bandwidth, samples.
    """
    left = residual - residual.mean(axis=0)
    power = (left**2).sum(axis=0)
    long_run = (moving_sums(left, length) ** 2).sum(axis=0) / length
    result: FloatArray = np.maximum(long_run / np.where(power > 0, power, 1.0), 1.0)
    return result


def score_covariance(scores: FloatArray, length: int) -> FloatArray:
    """Covariance of a sum of correlated scores, (n_unknown, n_unknown), with Bartlett's kernel: never negative.

    Parameters
    ----------
    scores
        What each sample adds to the gradient, (n_sample, n_unknown), of one experiment.
    length
        Bandwidth, samples.
    """
    sums = moving_sums(scores, length)
    result: FloatArray = sums.T @ sums / length
    return result


def moving_sums(values: FloatArray, length: int) -> FloatArray:
    """Sums over every window of a length that touches the samples, (n_sample + length - 1, ...).

    Their mean square is the autocovariance under Bartlett's triangle.
    """
    still = np.zeros((length, *values.shape[1:]))
    total = np.cumsum(np.concatenate((still, values, still[:-1])), axis=0)
    result: FloatArray = total[length:] - total[:-length]
    return result


def sandwich(hessian: FloatArray, scores: FloatArray, precision: FloatArray, freedom: float) -> FloatArray:
    """Covariance of estimates with priors where residuals are coloured, (n_unknown, n_unknown).

    Parameters
    ----------
    hessian
        Of half the cost, priors included.
    scores
        Covariance of the gradient of the data's part.
    precision
        Of the priors, (n_unknown,).
    freedom
        Independent residuals: fitted unknowns have made them smaller.
    """
    inverse = scaled_inverse(hessian)
    fitted = float(np.trace(inverse @ (hessian - np.diag(precision))))
    lost = min(freedom / max(freedom - fitted, freedom / MOST_FOR_FREEDOM), MOST_FOR_FREEDOM)
    result: FloatArray = inverse @ (lost * scores + np.diag(precision)) @ inverse
    return (result + result.T) / 2
