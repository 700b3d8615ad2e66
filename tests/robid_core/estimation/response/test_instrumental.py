"""Responses by instrumental variables against closed forms of a feedback loop, and their stated scatter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core import PoorExcitation
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.estimation.response.instrumental import (
    InstrumentalResponse,
    instrumental_response,
    multiple_coherence,
    response_of_periods,
    scatter,
)


def circular(generator: np.random.Generator, *shape: int) -> Any:
    """Complex Gaussian numbers of mean square one."""
    return (generator.standard_normal((*shape, 2)) @ np.array([1, 1j])) / np.sqrt(2)


def loop(n_column: int, n_line: int = 1, noise: float = 0.7, seed: int = 0) -> Any:
    """u = r - F y, y = G u + v for one axis at lines that are alike: (u, y, r, G, F)."""
    generator = np.random.default_rng(seed)
    g, f = 0.8 - 0.6j, 0.5 + 1.1j
    r, v = circular(generator, n_line, 1, n_column), noise * circular(generator, n_line, 1, n_column)
    y = (g * r + v) / (1 + f * g)
    return r - f * y, y, r, g, f


def test_in_feedback_the_direct_approach_has_the_known_limit_and_the_reference_gives_the_plant() -> None:
    # Direct: E[y u*] / E[u u*], u = (r - F v) / (1 + F G), y = (G r + v) / (1 + F G), so
    # (G S_rr - F* S_vv) / (S_rr + |F|^2 S_vv). From n = 40000 samples each estimate scatters by about
    # |V| / (|U| sqrt(n)) < 0.01; five of that.
    u, y, r, g, f = loop(40000)
    s_v = 0.7**2
    limit = (g - np.conj(f) * s_v) / (1 + abs(f) ** 2 * s_v)
    assert abs(limit - g) > 0.3
    assert abs(instrumental_response(u, y, None).response[0, 0, 0] - limit) < 0.05
    assert abs(instrumental_response(u, y, r).response[0, 0, 0] - g) < 0.05


def test_square_instruments_give_the_ratio_of_cross_spectra() -> None:
    generator = np.random.default_rng(3)
    u, y, z = (circular(generator, 4, 2, 9) for _ in range(3))
    z_h = z.conj().swapaxes(-1, -2)
    expected = (y @ z_h) @ np.linalg.inv(u @ z_h)
    np.testing.assert_allclose(instrumental_response(u, y, z).response, expected, rtol=1e-9)


def test_more_instruments_than_inputs_are_two_stage_least_squares_in_any_unit() -> None:
    generator = np.random.default_rng(4)
    u, y, z = circular(generator, 3, 2, 12), circular(generator, 3, 2, 12), circular(generator, 3, 5, 12)
    first = np.stack([u[k] @ np.linalg.pinv(z[k]) @ z[k] for k in range(3)])
    expected = np.stack([y[k] @ np.linalg.pinv(first[k]) for k in range(3)])
    np.testing.assert_allclose(instrumental_response(u, y, z).response, expected, rtol=1e-9)
    scaled = z * np.array([1e-3, 1, 20, 5, 1e2])[:, None]
    np.testing.assert_allclose(instrumental_response(u, y, scaled).response, expected, rtol=1e-9)


def test_coherence_is_the_share_of_power_that_the_inputs_explain() -> None:
    # y = G u + v with |G u|^2 = 2 and |v|^2 = 1: 2/3, up to the 1 / sqrt(n) of the powers.
    generator = np.random.default_rng(5)
    u, v = circular(generator, 1, 2, 20000), circular(generator, 1, 1, 20000)
    assert multiple_coherence(u, np.sum(u, axis=1, keepdims=True) + v)[0, 0] == pytest.approx(2 / 3, abs=0.02)
    # Noise alone: a Beta(2, n - 2) of mean 2 / n over lines.
    few = multiple_coherence(circular(generator, 4000, 2, 8), circular(generator, 4000, 1, 8))
    assert few.mean() == pytest.approx(2 / 8, abs=4 * few.std() / np.sqrt(4000))


def test_scatter_of_correlated_columns_is_that_of_the_matrices() -> None:
    generator = np.random.default_rng(6)
    root = np.eye(9) + 0.4 * circular(generator, 9, 9)
    gamma = root @ root.conj().T
    u, y = circular(generator, 2, 2, 9), circular(generator, 2, 3, 9)
    estimate = instrumental_response(u, y, None)
    trace, square = np.trace(gamma).real, np.trace(gamma @ gamma).real
    result = scatter(estimate, lambda x: x @ gamma.conj(), trace, square)
    for line in range(2):
        x = np.linalg.pinv(u[line])
        q, k = np.eye(9) - x @ u[line], gamma.conj()
        weight = np.trace(k @ q).real
        assert result.weight[line] == pytest.approx(weight)
        assert result.degrees_of_freedom[line] == pytest.approx(weight**2 / np.trace(k @ q @ k @ q).real)
        np.testing.assert_allclose(result.gram_inverse[line], x.conj().T @ k @ x, atol=1e-12)
        residual = y[line] @ q
        np.testing.assert_allclose(result.products[line], residual @ residual.conj().T, atol=1e-12)


def test_uncorrelated_columns_leave_as_many_degrees_of_freedom_as_there_are_columns_to_spare() -> None:
    generator = np.random.default_rng(7)
    for n_column, spare in ((8, 5), (3, 0)):
        estimate = instrumental_response(
            circular(generator, 1, 3, n_column), circular(generator, 1, 2, n_column), None
        )
        result = scatter(estimate, lambda x: x, n_column, n_column)
        assert result.weight[0] == pytest.approx(spare)
        assert result.degrees_of_freedom[0] == pytest.approx(spare)


@pytest.mark.parametrize("approach", ["direct", "reference"])
def test_stated_regions_of_correlated_columns_cover_the_mean(approach: str) -> None:
    # Inputs given, disturbances with a known correlation between columns: dG is complex normal with the stated
    # covariance, so |dG|^2 / s^2 follows F(2, 2 nu) where nu is exact, and by Satterthwaite nearly so. 4000 lines:
    # binomial standard deviation 0.34 %, and 1 % for the approximation.
    generator = np.random.default_rng(8)
    n_line, n_column = 4000, 10
    root = np.linalg.cholesky(0.5 ** np.abs(np.subtract.outer(np.arange(n_column), np.arange(n_column))))
    gamma = root @ root.T
    u = circular(generator, n_line, 2, n_column)
    z = None if approach == "direct" else u + 0.3 * circular(generator, n_line, 2, n_column)
    mix = np.array([[1.0, 0.0], [0.6, 0.5]])
    v = mix @ circular(generator, n_line, 2, n_column) @ root.T
    g = np.array([[1, 2j], [0.5, -1]])
    estimate = instrumental_response(u, g @ u + v, z)
    result = scatter(estimate, lambda x: x @ gamma, np.trace(gamma), np.trace(gamma @ gamma))
    covariance = result.products / result.weight[:, None, None]
    for i, j in ((0, 0), (1, 0), (1, 1)):
        variance = covariance[:, i, i].real * result.gram_inverse[:, j, j].real
        radius = confidence_radius(variance, result.degrees_of_freedom)
        covered = np.mean(np.abs(estimate.response[:, i, j] - g[i, j]) <= radius)
        assert abs(covered - 0.95) < 3 * 0.0034 + 0.01


def test_an_experiment_counts_once_however_many_periods_it_has() -> None:
    # The same distortion in every period: the residual of the average over periods is all of it, 12 experiments of
    # one axis leave 11 degrees of freedom, and the expectation over 500 lines is right to 3 / sqrt(11 * 500).
    generator = np.random.default_rng(9)
    n_line, n_exp, n_period = 500, 12, 4
    u = np.repeat(circular(generator, n_line, 1, n_exp)[..., None], n_period, axis=-1)
    distortion = np.repeat(circular(generator, n_line, 1, n_exp)[..., None], n_period, axis=-1)
    noise = 0.1 * circular(generator, n_line, 1, n_exp, n_period)
    found = response_of_periods(u, 2.0 * u + distortion + noise, None, lambda x: x, n_exp, n_exp)
    np.testing.assert_allclose(found.scatter.degrees_of_freedom, n_exp - 1)
    level = (found.scatter.products[:, 0, 0].real / found.scatter.weight).mean()
    assert level == pytest.approx(1 + 0.01 / n_period, rel=3 / np.sqrt(11 * n_line))
    assert found.noise_products is not None
    noise_level = found.noise_products[:, 0, 0].real.mean() / ((n_period - 1) * n_exp)
    assert noise_level == pytest.approx(0.01 / n_period, rel=3 / np.sqrt(36 * n_line))
    errors = np.abs(found.response[:, 0, 0] - 2.0) ** 2 / found.scatter.gram_inverse[:, 0, 0].real
    assert stats.kstest(errors, "expon", args=(0, 1 + 0.01 / n_period)).pvalue > 1e-3


def test_lines_whose_instruments_do_not_span_the_inputs_are_nan_and_leave_the_others_alone() -> None:
    generator = np.random.default_rng(10)
    u, y, z = (circular(generator, 3, 2, 6) for _ in range(3))
    z[1, 1] = z[1, 0]
    estimate: InstrumentalResponse = instrumental_response(u, y, z)
    assert np.isnan(estimate.response[1]).all()
    np.testing.assert_allclose(
        estimate.response[[0, 2]], instrumental_response(u[[0, 2]], y[[0, 2]], z[[0, 2]]).response
    )
    with pytest.raises(PoorExcitation, match="1 instruments cannot stand for 2 inputs"):
        instrumental_response(u, y, z[:, :1])
