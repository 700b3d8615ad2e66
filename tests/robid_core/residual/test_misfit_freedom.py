"""Degrees of freedom behind the entries of a table of misfits, counted by hand and against their scatter."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from robid_core.residual.misfit import freedom_of

FREQUENCY = np.array([0.0, 1.0, 2.0, 4.0, 5.0, 6.0])
EXCITED = np.array([False, False, False, True, False, True])
EDGES = np.array([0.0, 3.0, 10.0])


def block(freedom: float, used: Any = None, share: float = 1.0) -> Any:
    """Two configurations of three experiments, six bins, one axis."""
    motion = SimpleNamespace(frequency_hz=FREQUENCY, excited=EXCITED, bin=np.arange(6))
    return SimpleNamespace(
        motion=motion, used=used, noise_freedom=freedom,
        measured=np.zeros((2, 3, 6, 1)), share=np.full((2, 3, 6, 1), share),
    )  # fmt: skip


def test_each_bin_counts_twice_but_the_mean() -> None:
    lines, others = freedom_of(block(np.inf), EDGES)
    np.testing.assert_allclose(lines, [[0, 2 * 6 * 2]])
    np.testing.assert_allclose(others, [[2 * 6 * 2, 2 * 6]])


def test_experiments_that_do_not_count_and_fitted_shares_are_left_out() -> None:
    used = np.array([[True, False, True], [False, False, True]])
    lines, _ = freedom_of(block(np.inf, used, share=0.5), EDGES)
    np.testing.assert_allclose(lines, [[0, 3 * 2]])


@pytest.mark.parametrize("of_noise", [6, 20])
def test_an_estimated_noise_counts_as_its_scatter(of_noise: int) -> None:
    """Powers of complex residuals over powers of m others: the variance of their mean is that of chi-square."""
    draw = np.random.default_rng(1)
    n_bin, n_draw = 12, 40_000
    power = draw.exponential(size=(n_draw, n_bin))
    noise = draw.gamma(of_noise, size=(n_draw, n_bin)) / of_noise
    mean = (power / noise).mean(axis=1)
    lines, _ = freedom_of(block(float(of_noise)), EDGES)
    assert mean.var() / mean.mean() ** 2 == pytest.approx(2 / float(lines[0, 1]), rel=0.15)
