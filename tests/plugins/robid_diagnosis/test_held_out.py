"""Residuals of data left out, against fits that did not have them."""

from __future__ import annotations

import numpy as np

from robid_core.residual import Weighting
from robid_diagnosis.held_out import left_out, unweighted


def test_data_left_out_are_predicted_by_a_fit_without_them() -> None:
    """A linear problem with priors, fitted anew by numpy without the rows: the same to rounding."""
    generator = np.random.default_rng(1)
    rows, measured = generator.standard_normal((60, 7)), generator.standard_normal(60)
    prior = np.diag(generator.uniform(0.1, 3.0, 7))
    whole = rows.T @ rows + prior
    residual = measured - rows @ np.linalg.solve(whole, rows.T @ measured)
    for out in (slice(0, 20), slice(20, 33)):
        kept = np.setdiff1d(np.arange(60), np.arange(60)[out])
        size = np.linalg.solve(rows[kept].T @ rows[kept] + prior, rows[kept].T @ measured[kept])
        expected = measured[out] - rows[out] @ size
        left, step = left_out(rows[out], residual[out], whole)
        np.testing.assert_allclose(left, expected, atol=1e-12)
        np.testing.assert_allclose(np.linalg.solve(whole, rows.T @ measured) - step, size, atol=1e-12)


def test_weights_come_off_again() -> None:
    generator = np.random.default_rng(2)
    matrix = generator.standard_normal((5, 2, 2)) + 1j * generator.standard_normal((5, 2, 2))
    spectra = generator.standard_normal((3, 4, 5, 2)) + 1j * generator.standard_normal((3, 4, 5, 2))
    weighting = Weighting(matrix)
    np.testing.assert_allclose(unweighted(weighting, weighting.residual(spectra)), spectra, atol=1e-12)
