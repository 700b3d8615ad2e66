"""Weights of residuals and of derivatives: both against a loop over bins."""

from __future__ import annotations

import numpy as np

from robid_core.residual import Weighting

N_CONFIG, N_EXP, N_BIN, N_ROW = 2, 3, 5, 4
ROUNDING = 1e-13  # of sums of four products of numbers of size one


def complex_normal(generator: np.random.Generator, *shape: int) -> np.ndarray:
    return generator.standard_normal(shape) + 1j * generator.standard_normal(shape)


def test_residuals_and_derivatives_are_whitened_bin_by_bin() -> None:
    """Real parts of all bins stand before imaginary ones; a derivative is weighted as the residual that it changes."""
    generator = np.random.default_rng(3)
    matrix = complex_normal(generator, N_BIN, N_ROW, N_ROW)
    residual = complex_normal(generator, N_CONFIG, N_EXP, N_BIN, N_ROW)
    weighting, expected = Weighting(matrix), np.empty((N_CONFIG, N_EXP, 2 * N_BIN * N_ROW))
    for c in range(N_CONFIG):
        for e in range(N_EXP):
            white = np.array([matrix[b] @ residual[c, e, b] for b in range(N_BIN)])
            expected[c, e] = np.concatenate((white.real.ravel(), white.imag.ravel()))
    np.testing.assert_allclose(weighting.residual(residual), expected, atol=ROUNDING)
    single = weighting.residual(residual.astype(np.complex64))
    np.testing.assert_allclose(single, expected, atol=10 * np.finfo(np.float32).eps)
    own = weighting.columns(0, [residual[0].swapaxes(0, 1)[..., None]])
    np.testing.assert_allclose(own.reshape(expected[0].shape), expected[0], atol=ROUNDING)


def test_experiments_that_do_not_count_have_rows_of_zeros() -> None:
    generator = np.random.default_rng(4)
    matrix = complex_normal(generator, N_BIN, N_ROW, N_ROW)
    residual = complex_normal(generator, N_CONFIG, N_EXP, N_BIN, N_ROW)
    used = np.array([[True, False, True], [True, True, True]])
    every, some = Weighting(matrix), Weighting(matrix, used=used)
    expected = np.where(used[..., None], every.residual(residual), 0.0)
    np.testing.assert_array_equal(some.residual(residual), expected)
    columns = residual[0].swapaxes(0, 1)[..., None]
    own = some.columns(0, [columns]).reshape(expected[0].shape)
    np.testing.assert_allclose(own, expected[0], atol=ROUNDING)
