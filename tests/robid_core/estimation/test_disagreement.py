"""Means of groups of unequal size: Cochran's statistic by hand, its mean, and a group that is off."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from robid_core import FloatArray
from robid_core.estimation.disagreement import (
    Disagreement,
    ExperimentShare,
    disagreement,
    spread_over_experiments,
)

SIZES = (5, 20, 80, 400)


def shares_of(groups: list[FloatArray]) -> list[ExperimentShare]:
    """The common mean of groups with unit variance: the gradient is the sum of residuals."""
    mean = np.concatenate(groups).mean()
    return [
        ExperimentShare(np.full((1, 1), len(g)), np.array([len(g) * mean - g.sum()]), np.full((1, 1), len(g)))
        for g in groups
    ]


def of_means(groups: list[FloatArray]) -> Disagreement:
    n = float(sum(SIZES))
    return disagreement(shares_of(groups), np.full((1, 1), n), np.full((1, 1), 1 / n), np.eye(1), 1e9)


def test_the_statistic_is_that_of_the_means_of_the_rest() -> None:
    """Without group i the mean moves by m_i (mean - mean_i) / (N - m_i), with a variance m_i / (N - m_i)^2."""
    groups = [np.random.default_rng(1).standard_normal(n) for n in SIZES]
    mean = np.concatenate(groups).mean()
    without = [np.concatenate(groups[:i] + groups[i + 1 :]).mean() for i in range(len(SIZES))]
    n = sum(SIZES)
    total = sum((w - mean) ** 2 * (n - m) ** 2 / m for w, m in zip(without, SIZES, strict=True))
    found = of_means(groups)
    assert found.p_value[0] == pytest.approx(scipy.stats.chi2.sf(total, 3), rel=1e-5)
    assert found.ratio[0] == pytest.approx(np.sqrt(total / 3))


def test_like_groups_have_uniform_chances_and_an_odd_one_none() -> None:
    draw, chances = np.random.default_rng(2), []
    for _ in range(400):
        chances.append(of_means([draw.standard_normal(n) for n in SIZES]).p_value[0])
    # 400 with a chance of 0.05 each: 20, deviation 4.4.
    assert 7 <= np.sum(np.array(chances) < 0.05) <= 33
    odd = [draw.standard_normal(n) + (0.8 if n == 80 else 0.0) for n in SIZES]
    assert of_means(odd).p_value[0] < 1e-6


def test_the_spread_over_experiments_is_the_jackknife_of_the_mean() -> None:
    """By hand of unequal groups; of like ones the standard error, and what differs from run to run is in it."""
    draw = np.random.default_rng(3)
    groups = [draw.standard_normal(n) for n in SIZES]
    without = np.array([np.concatenate(groups[:i] + groups[i + 1 :]).mean() for i in range(len(SIZES))])
    by_hand = np.sqrt(3 / 4 * ((without - without.mean()) ** 2).sum())
    whole = np.full((1, 1), float(sum(SIZES)))
    assert spread_over_experiments(shares_of(groups), whole, 2 * np.eye(1))[0] == pytest.approx(2 * by_hand)
    alike, apart = [], []
    for _ in range(200):
        runs = [draw.standard_normal(50) for _ in range(8)]
        hessian = np.full((1, 1), 400.0)
        alike.append(spread_over_experiments(shares_of(runs), hessian, np.eye(1))[0] ** 2)
        runs = [run + draw.standard_normal() for run in runs]
        apart.append(spread_over_experiments(shares_of(runs), hessian, np.eye(1))[0] ** 2)
    # Chi-square with 7 degrees of freedom: a mean of 200 scatters by sqrt(2 / 7 / 200), 3.8 %.
    assert np.mean(alike) == pytest.approx(1 / 400, rel=0.12)
    assert np.mean(apart) == pytest.approx(1 / 400 + 1 / 8, rel=0.12)


def test_two_experiments_have_no_spread() -> None:
    runs = [np.ones(5), np.zeros(5)]
    assert np.isnan(spread_over_experiments(shares_of(runs), np.full((1, 1), 10.0), np.eye(1))).all()
