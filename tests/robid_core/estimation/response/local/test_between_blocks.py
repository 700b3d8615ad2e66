"""Blocks that differ as wholes widen the regions of local fits; blocks that differ by noise leave them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core.estimation.response.local.between_blocks import widening
from robid_core.estimation.response.local.fit import local_rational
from robid_core.estimation.response.local.model import LocalModel
from robid_core.testing.plants import MassSpringPlant

FREQUENCY = np.linspace(21, 80, 60)
N_BLOCK, RUNS = 4, 40


def gaussian(generator: np.random.Generator, *shape: int) -> Any:
    parts = generator.standard_normal((2, *shape))
    return (parts[0] + 1j * parts[1]) / np.sqrt(2)


def mean_square_over_stated(differ: float, model: LocalModel, **settings: Any) -> float:
    """Squares of errors about the mean of all runs over what is stated; blocks have gains that `differ`."""
    generator = np.random.default_rng(3)
    truth = MassSpringPlant.of(2).response(FREQUENCY)
    responses, stated = [], []
    for _ in range(RUNS):
        u = gaussian(generator, 60, 2, 2 * N_BLOCK)
        gain = 1 + differ * np.repeat(gaussian(generator, N_BLOCK), 2)
        y = truth @ (gain * u + 0.02 * gaussian(generator, 60, 2, 2 * N_BLOCK))
        fit = local_rational(u, y, FREQUENCY, model, **settings)
        assert fit.output_covariance is not None
        responses.append(fit.response)
        stated.append(np.einsum("fii,fjj->fij", fit.output_covariance, fit.gram_inverse).real)
    error = np.array(responses) - np.mean(responses, axis=0)
    return float(np.mean(np.abs(error) ** 2 / np.array(stated)) * RUNS / (RUNS - 1))


@pytest.mark.parametrize("model", [LocalModel("mimo"), LocalModel("miso", 2, 0)], ids=str)
def test_blocks_that_differ_as_wholes_widen_the_regions(model: LocalModel) -> None:
    assert mean_square_over_stated(0.03, model, window_lines=15) > 3
    # A factor from three differences has a heavy-tailed inverse: 3 / (3 - 1) of the square on average, at most, and
    # the errors of a run go together.
    assert 0.6 < mean_square_over_stated(0.03, model, window_lines=15, n_block=N_BLOCK) < 2.1


@pytest.mark.parametrize("model", [LocalModel("mimo"), LocalModel("miso", 2, 0)], ids=str)
def test_blocks_that_differ_by_noise_leave_the_regions(model: LocalModel) -> None:
    plain = mean_square_over_stated(0.0, model, window_lines=15)
    assert mean_square_over_stated(0.0, model, window_lines=15, n_block=N_BLOCK) == pytest.approx(
        plain, rel=0.15
    )


def test_too_little_without_a_block_and_one_block_leave_what_residuals_say() -> None:
    generator = np.random.default_rng(4)
    u = gaussian(generator, 60, 2, 2)
    y = MassSpringPlant.of(2).response(FREQUENCY) @ (u + 0.02 * gaussian(generator, 60, 2, 2))
    covariances = [
        local_rational(u, y, FREQUENCY, LocalModel("mimo"), n_block=n).output_covariance for n in (1, 2)
    ]
    assert np.array_equal(*covariances)


def test_the_factor_is_a_mean_over_entries_and_neighbours() -> None:
    variance, stated = np.ones((9, 6, 6)), np.ones((9, 6, 6))
    variance[4] = 4.0
    valid = np.ones(9, dtype=bool)
    factor, freedom = widening(variance, stated, valid, 4)
    assert factor == pytest.approx([1, 1, 1, 2, 2, 2, 1, 1, 1])
    assert freedom == 3 * 36 * 3 / 2
    valid[3] = False
    variance[3] = np.nan
    factor, _ = widening(variance, stated, valid, 4)
    assert factor[4] == pytest.approx(2.5)
    assert np.isfinite(factor).all()
