"""Whether experiments of one fit tell the same parameters: each left out in turn, against what its residuals explain.

About its minimum a fit without experiment i is one Gauss-Newton step away: with the Hessian H of half the cost, the
experiment's share M_i of it and of the gradient g_i, coordinates move by ``d_i = (H - M_i)^-1 g_i``. If experiments are
alike, ``d_i`` scatters with the covariance ``(H - M_i)^-1 S_i (H - M_i)^-1``, S_i that of the experiment's scores,
counting their memory. For a number that is a combination of coordinates, the sum over experiments of its squared moves
over their variances has the mean n - 1 whatever their sizes (W. G. Cochran, Biometrics 10, 1954, for means), and is
held against an F distribution, because variances are estimated, too; Bonferroni's bound for all numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.estimation.scaled_inverse import scaled_inverse

FEWEST = 3  # experiments, for a spread
UNSEEN = 1e-9  # of a variance: an experiment that says less of a number cannot disagree on it


@dataclass(frozen=True, eq=False)
class ExperimentShare:
    """Gradient and curvature that one experiment contributes to a fit at its minimum."""

    information: FloatArray
    """To the Hessian of half the cost, (n_unknown, n_unknown)."""
    gradient: FloatArray
    """To its gradient, (n_unknown,)."""
    scores: FloatArray
    """Covariance of that gradient, the memory of residuals counted, (n_unknown, n_unknown)."""


@dataclass(frozen=True, eq=False)
class Disagreement:
    """How far experiments disagree on numbers, (n_number,) each."""

    ratio: FloatArray
    """By which experiments are further apart than their residuals explain (R. T. Birge, Physical Review 40, 1932)."""
    p_value: FloatArray
    """Probability of such moves where experiments are alike, times the count of numbers."""


def disagreement(
    experiments: Sequence[ExperimentShare],
    hessian: FloatArray,
    covariance: FloatArray,
    directions: FloatArray,
    freedom: float,
) -> Disagreement:
    """Hold the moves of numbers against what residuals explain.

    Parameters
    ----------
    experiments
        Two at least.
    hessian
        Of half the cost, priors included, (n_unknown, n_unknown).
    covariance
        As stated, (n_unknown, n_unknown).
    directions
        Numbers per unit of each coordinate, (n_number, n_unknown).
    freedom
        Independent residuals that tell the scores' covariances.
    """
    n_number = len(directions)
    total, seen = np.zeros(n_number), np.zeros(n_number)
    for one in experiments:
        inverse = directions @ scaled_inverse(hessian - one.information)
        moved = (inverse @ one.gradient) ** 2
        variance = np.einsum("bi,ij,bj->b", inverse, one.scores, inverse)
        counts = variance > UNSEEN * np.einsum("bi,ij,bj->b", directions, covariance, directions)
        total += np.where(counts, moved / np.where(counts, variance, 1.0), 0.0)
        seen += counts
    count = np.maximum(seen - 1, 1.0)
    tail = scipy.stats.f.sf(total / count, count, max(freedom, 1.0))
    return Disagreement(np.sqrt(total / count), np.where(seen > 1, np.minimum(n_number * tail, 1.0), 1.0))


def spread_over_experiments(
    experiments: Sequence[ExperimentShare], hessian: FloatArray, directions: FloatArray
) -> FloatArray:
    """Return standard errors of numbers as the spread over experiments says, (n_number,); NaN of fewer than three.

    Of the fits without each of n experiments, sqrt((n - 1) / n sum (x_i - mean)^2) (J. W. Tukey's jackknife, 1958). It
    assumes that experiments are alike, and nothing of the residuals within them: beside a stated error it says whether
    that holds from one run to the next. Relative to itself it scatters by 1 / sqrt(2 (n - 1)).

    Parameters
    ----------
    experiments
        What each contributes to a fit at its minimum.
    hessian
        Of half the cost, priors included, (n_unknown, n_unknown).
    directions
        Numbers per unit of each coordinate, (n_number, n_unknown).
    """
    n = len(experiments)
    if n < FEWEST:
        return np.full(len(directions), np.nan)
    moves = np.array([scaled_inverse(hessian - one.information) @ one.gradient for one in experiments])
    numbers = moves @ directions.T
    spread: FloatArray = np.sqrt((n - 1) * numbers.var(axis=0))
    return spread
