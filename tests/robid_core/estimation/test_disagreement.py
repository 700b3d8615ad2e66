"""Means of groups of unequal size: Cochran's statistic by hand, its mean, and a group that is off."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from robid_core import FloatArray
from robid_core.estimation.disagreement import Disagreement, ExperimentShare, disagreement

SIZES = (5, 20, 80, 400)


def of_means(groups: list[FloatArray]) -> Disagreement:
    """The common mean of groups with unit variance: the gradient is the sum of residuals."""
    mean = np.concatenate(groups).mean()
    shares = [
        ExperimentShare(np.full((1, 1), len(g)), np.array([len(g) * mean - g.sum()]), np.full((1, 1), len(g)))
        for g in groups
    ]
    n = float(sum(SIZES))
    return disagreement(shares, np.full((1, 1), n), np.full((1, 1), 1 / n), np.eye(1), 1e9)


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
