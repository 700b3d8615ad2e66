"""Standard errors from leaving out configurations: exact on linear problems, honest with common errors."""

import numpy as np

from robid_core.estimation.intervals import (
    covariance_of_curves,
    covariance_with_model_error,
    jackknife_shifts,
)


def linear_problem(rng: np.random.Generator, common: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Four groups of 50 residuals on three unknowns; a common error per group that depends on the regressors."""
    j = rng.standard_normal((4, 50, 3))
    bias = common * rng.standard_normal((4, 1, 3))
    y = (j * bias).sum(axis=2) + rng.standard_normal((4, 50))
    return j, y, np.zeros(3)


def estimate(j: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows, targets = j.reshape(-1, 3), y.reshape(-1)
    x = np.linalg.lstsq(rows, targets, rcond=None)[0]
    residual = np.einsum("gni,i->gn", j, x) - y
    return x, np.einsum("gni,gn->gi", j, residual), np.einsum("gni,gnk->gik", j, j)


def test_shifts_are_the_exact_leave_one_out_estimates_of_a_linear_problem() -> None:
    rng = np.random.default_rng(5)
    j, y, _ = linear_problem(rng, 0.5)
    x, gradients, matrices = estimate(j, y)
    shifts = jackknife_shifts(matrices.sum(axis=0), gradients, matrices)
    for g in range(4):
        keep = [i for i in range(4) if i != g]
        without = np.linalg.lstsq(j[keep].reshape(-1, 3), y[keep].reshape(-1), rcond=None)[0]
        np.testing.assert_allclose(x + shifts[g], without, rtol=1e-9, atol=1e-12)


def test_a_parameter_that_one_group_alone_tells_moves_with_no_other() -> None:
    """Its error is the formal one, and it widens no other; without a limit it would, by thousands."""
    rng = np.random.default_rng(7)
    j, y, _ = linear_problem(rng, 0.0)
    j[1:, :, 2] *= 1e-3
    y[1:] -= j[1:, :, 2]
    _, gradients, matrices = estimate(j, y)
    total = matrices.sum(axis=0)
    shifts = jackknife_shifts(total, gradients, matrices)
    assert shifts[0, 2] == 0
    assert (shifts[:, :2] != 0).all()
    stated, formal = (
        np.sqrt(np.diag(one))
        for one in (covariance_with_model_error(np.linalg.inv(total), shifts), np.linalg.inv(total))
    )
    assert (stated < 2 * formal).all()


def test_stated_errors_follow_the_scatter_with_and_without_common_errors() -> None:
    """400 draws: stated over real standard deviation stays within the jackknife's own bias."""
    for common in (0.0, 1.0):
        rng = np.random.default_rng(6)
        found, stated = [], []
        for _ in range(400):
            j, y, _ = linear_problem(rng, common)
            x, gradients, matrices = estimate(j, y)
            total = matrices.sum(axis=0)
            shifts = jackknife_shifts(total, gradients, matrices)
            found.append(x)
            stated.append(np.diag(covariance_with_model_error(np.linalg.inv(total), shifts)))
        ratio = np.sqrt(np.mean(stated, axis=0) / np.var(found, axis=0))
        # With four groups the jackknife is conservative (Efron and Stein 1981); the floor at the formal
        # variance adds to it where there is no common error.
        assert (ratio > 0.85).all(), ratio
        assert (ratio < 1.6).all(), ratio


def test_functions_that_make_a_curve_are_widened_together() -> None:
    """Three regressors that are nearly alike: their sum is well known, whatever leaving a group out does to each."""
    rng = np.random.default_rng(8)
    curve = [[0, 1, 2]]
    together, torn = [], []
    for _ in range(60):
        j, y, _ = linear_problem(rng, 0.0)
        j[..., 1:] = j[..., :1] + 1e-3 * j[..., 1:]
        _, gradients, matrices = estimate(j, y)
        total = matrices.sum(axis=0)
        formal, shifts = np.linalg.inv(total), jackknife_shifts(total, gradients, matrices)
        known = np.ones(3) @ formal @ np.ones(3)
        stated = covariance_of_curves(formal, total, gradients, matrices, curve)
        together.append(np.ones(3) @ stated @ np.ones(3) / known)
        torn.append(np.ones(3) @ covariance_with_model_error(formal, shifts) @ np.ones(3) / known)
        assert (np.linalg.eigvalsh(stated - formal * (1 - 1e-6)) > -1e-9 * np.trace(stated)).all()
    # Of the sum, as of any parameter: four groups scatter by chi-squared of three; torn apart by thousands.
    assert max(together) < 5
    assert np.median(together) < 1.5
    assert np.median(torn) > 50
