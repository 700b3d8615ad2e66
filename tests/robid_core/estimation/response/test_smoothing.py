"""Local polynomials over lines that are not evenly apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import savgol_coeffs

from robid_core.errors import DataRejected
from robid_core.estimation.response.covariance import difference_products
from robid_core.estimation.response.smoothing import (
    polynomial_weights,
    products_through_smoothing,
    smooth_over_lines,
)


def test_polynomials_pass_and_even_lines_have_the_known_weights() -> None:
    frequency = np.geomspace(4, 80, 20)
    index, weight = polynomial_weights(frequency, 3, 2)
    values = (1 + 2j) - 0.3 * frequency + 0.01j * frequency**2
    assert smooth_over_lines(values, index, weight) == pytest.approx(values, rel=1e-9)
    assert np.abs(smooth_over_lines(frequency**3 + 0j, index, weight) - frequency**3).max() > 1
    _, weight = polynomial_weights(np.arange(1.0, 12.0), 2, 2)
    assert weight[5] == pytest.approx(savgol_coeffs(5, 2), rel=1e-9)


def test_without_neighbours_lines_stand_for_themselves_and_too_few_are_refused() -> None:
    index, weight = polynomial_weights(np.arange(1.0, 4.0), 0, 2)
    assert index.tolist() == [[0], [1], [2]]
    assert weight.tolist() == [[1], [1], [1]]
    assert len(polynomial_weights(np.zeros(0), 2, 2)[0]) == 0
    with pytest.raises(DataRejected, match="3 usable lines are fewer than the 5"):
        polynomial_weights(np.arange(1.0, 4.0), 2, 2)


def test_stated_covariance_behind_smoothing_is_the_scatter() -> None:
    # Error e = dG_ry - G sum_l w_l dG_ru(l) with correlated noise of both: its covariance against 4000 draws. Gram
    # matrices of the references differ from line to line by a factor, as those of orthogonal multisines do.
    generator = np.random.default_rng(3)
    n, n_freq, trials, n_exp = 2, 7, 4000, 3

    def normal(*shape: int) -> Any:
        return (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2)

    index, weight = polynomial_weights(np.geomspace(5, 9, n_freq), 2, 1)
    response, root = normal(n_freq, n, n), normal(n_freq, 2 * n, 2 * n)
    strength = np.geomspace(1, 3, n_freq)
    gram_inverse = strength[:, None, None] * np.eye(n) / n_exp
    # Columns of dG_r have covariance C times the inverse Gram matrix's diagonal.
    error = root @ normal(trials, n_freq, 2 * n, n) * np.sqrt(strength / n_exp)[:, None, None]
    to_y, to_u = error[..., :n, :], error[..., n:, :]
    smooth = np.moveaxis(smooth_over_lines(np.moveaxis(to_u, 1, 0), index, weight), 0, 1)
    total = (to_y - response @ smooth)[..., 0]
    scatter = np.einsum("tki,tkj->kij", total, total.conj()) / trials
    covariance = root @ root.conj().swapaxes(-1, -2)
    stated = products_through_smoothing(covariance, response, gram_inverse, index, weight)
    stated *= gram_inverse[:, :1, :1].real
    # Entries of a complex Wishart matrix over T draws scatter by sqrt(C_ii C_jj / T).
    size = np.sqrt(np.einsum("kii,kjj->kij", stated, stated).real / trials)
    assert (np.abs(scatter - stated) < 5 * size).all()


def test_products_of_differences_count_one_degree_less_than_periods() -> None:
    generator = np.random.default_rng(1)
    error = generator.standard_normal((5000, 2, 3, 4)) + 1j * generator.standard_normal((5000, 2, 3, 4))
    # (P - 1) n_exp times the covariance of the period average, 2 / P each.
    mean = difference_products(error + 7.0).mean(axis=0)
    assert mean == pytest.approx(3 * 3 * 2 / 4 * np.eye(2), abs=0.2)
