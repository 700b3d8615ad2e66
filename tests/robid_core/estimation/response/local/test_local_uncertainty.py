"""Stated regions of local fits cover the estimator's own mean, at resonances and at the band's ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core.estimation.response.covariance import confidence_radius
from robid_core.estimation.response.local.covariance import dense_covariance, nearest_product
from robid_core.estimation.response.local.fit import local_rational
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.rational import Solution
from robid_core.testing.plants import MassSpringPlant

N_FREQ, RUNS = 60, 50


def gaussian(generator: np.random.Generator, *shape: int) -> Any:
    parts = generator.standard_normal((2, *shape))
    return (parts[0] + 1j * parts[1]) / np.sqrt(2)


def runs(
    parametrization: Any, approach: str, origin: str, n_exp: int, **settings: Any
) -> tuple[Any, Any, Any]:
    """Responses (run, line, 2, 2), radii and windows; resonances at 30 and 60 Hz, 2 % of noise."""
    generator = np.random.default_rng(n_exp)
    frequency = np.linspace(21, 80, N_FREQ)
    truth = MassSpringPlant.of(2).response(frequency)
    reference = np.exp(2j * np.pi * generator.random((N_FREQ, 2, n_exp)))
    feedback = 0.3 / np.abs(truth).max() * np.eye(2) * (approach == "jio")
    answers, radii = [], []
    for _ in range(RUNS):
        noise = 0.02 * gaussian(generator, N_FREQ, 2, n_exp)
        noise = (
            truth @ noise if origin == "torque" else noise * np.sqrt(np.mean(np.abs(truth @ reference) ** 2))
        )
        y = np.linalg.solve(np.eye(2) + truth @ feedback, truth @ reference + noise)
        fit = local_rational(
            reference - feedback @ y,
            y,
            frequency,
            LocalModel(parametrization, settings.get("order", 2), settings.get("order", 2)),
            reference=reference if approach == "jio" else None,
            iterations=settings.get("iterations", 0),
        )
        assert fit.output_covariance is not None
        variance = np.einsum("fii,fjj->fij", fit.output_covariance, fit.gram_inverse).real
        answers.append(fit.response)
        radii.append(confidence_radius(variance, fit.degrees_of_freedom[:, None, None]))
    return np.array(answers), np.array(radii), fit.windows


# Half of the eight cases in which each pair of choices occurs is in a plain run; the other half, in a full one.
HALF = [("direct", 1, "torque"), ("direct", 4, "sensor"), ("jio", 1, "sensor"), ("jio", 4, "torque")]
OTHER_HALF = [("direct", 1, "sensor"), ("direct", 4, "torque"), ("jio", 1, "torque"), ("jio", 4, "sensor")]


@pytest.mark.parametrize(
    ("approach", "n_exp", "origin"),
    [*HALF, *(pytest.param(*case, marks=pytest.mark.full) for case in OTHER_HALF)],
)
@pytest.mark.parametrize("parametrization", ["scalar", "miso", "mimo"])
def test_regions_cover_the_mean_of_the_estimator(
    parametrization: Any, approach: str, n_exp: int, origin: str
) -> None:
    answers, radii, windows = runs(parametrization, approach, origin, n_exp)
    covered = np.abs(answers - answers.mean(axis=0)) <= radii
    # Lines at least a window apart share no data; entries of a line have errors of the same rows, so a line
    # counts once. A region of the mean of 50 runs is too easily hit by 1 / 50 of the variance: 0.954 in place
    # of 0.95.
    apart = max(2, -(-N_FREQ // int(windows.size.max())))
    trials = RUNS * apart
    low = (
        stats.binom.ppf(1e-5, trials, 0.92) / trials
    )  # 3 % for what first order and the nearest product leave out
    high = stats.binom.ppf(1 - 1e-5, trials, 0.97) / trials
    assert low <= covered.mean() <= high
    # No line is left out: neither the resonances nor the ends, where the fitted denominator is smallest elsewhere.
    worst = covered.mean(axis=(0, 2, 3)).min()
    assert worst > stats.binom.ppf(1e-6, RUNS, 0.90) / RUNS


@pytest.mark.parametrize("n_exp", [1, pytest.param(4, marks=pytest.mark.full)])
@pytest.mark.parametrize(
    "parametrization",
    [
        "miso",
        pytest.param("scalar", marks=pytest.mark.full),
        pytest.param("mimo", marks=pytest.mark.full),
    ],
)
def test_regions_of_iterated_fits_cover_their_mean(parametrization: Any, n_exp: int) -> None:
    answers, radii, _ = runs(parametrization, "direct", "torque", n_exp, iterations=4)
    covered = (np.abs(answers - answers.mean(axis=0)) <= radii).mean()
    # 50 runs of at least four windows: standard error 1.5 %.
    assert 0.90 < covered < 0.985


def test_data_without_noise_state_a_covariance_of_rounding_errors() -> None:
    frequency = np.linspace(21, 80, 40)
    truth = MassSpringPlant.of(3).response(frequency)
    u = np.exp(2j * np.pi * np.random.default_rng(0).random((40, 3, 3)))
    for parametrization in ("scalar", "miso", "mimo"):
        fit = local_rational(u, truth @ u, frequency, LocalModel(parametrization))
        assert fit.output_covariance is not None
        np.linalg.cholesky(fit.output_covariance)
        np.linalg.cholesky(fit.gram_inverse)
    deviation = np.sqrt(np.einsum("fii,fjj->fij", fit.output_covariance, fit.gram_inverse).real)
    assert (deviation < 1e-10 * np.abs(truth).max()).all()


def test_a_kronecker_product_is_its_own_nearest() -> None:
    generator = np.random.default_rng(1)
    a, c = gaussian(generator, 5, 3, 3), gaussian(generator, 5, 2, 2)
    gram, output = (x @ x.conj().swapaxes(1, 2) for x in (a, c))
    dense = np.einsum("nik,njl->nijkl", output, gram)
    found, covariance = nearest_product(dense, output * np.array([[1.0, 0.3], [0.3, 2.0]]))
    # vec(G) has covariance conj(gram inverse) (x) output covariance.
    both = np.einsum("nik,njl->nijkl", covariance, found.conj())
    assert both == pytest.approx(dense, rel=1e-9)


@pytest.mark.parametrize("first", [1, 3])
def test_errors_reach_all_entries_through_a_common_denominator(first: int) -> None:
    n_out, n_in, n_line, n_exp, order = 3, 2, 4, 5, 2
    generator = np.random.default_rng(first)
    own = gaussian(generator, 1, first, n_in, n_line * n_exp)
    coupling = gaussian(generator, 1, order, n_out, n_in)
    pull = gaussian(generator, 1, order, n_line * n_exp, n_out)
    root = gaussian(generator, 1, n_out, n_out)
    products = root @ root.conj().swapaxes(1, 2)
    deviation = generator.random((1, n_line, n_out)) + 0.5
    none: Any = np.zeros(0)
    solution = Solution(none, none, none, none, own, none, coupling, pull)
    expected = np.zeros((n_out, n_in, n_out, n_in), dtype=np.complex128)
    for row in range(n_line * n_exp):
        # What an error of this row does to every entry, output by output: by itself, and by the denominator.
        effect = np.einsum("sij,sk->ijk", coupling[0], pull[0, :, row])
        for i in range(n_out):
            effect[i, :, i] += own[0, min(i, first - 1), :, row]
        scaled = effect * deviation[0, row // n_exp]
        expected += np.einsum("ijk,kl,abl->ijab", scaled, products[0], scaled.conj())
    found = dense_covariance(solution, products, deviation)[0]
    assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
