"""Stated covariances against Monte Carlo with a known truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.excitation.multisine import orthogonal_matrix
from robid_core.estimation.response import covariance as cv, means, spectra as sp


def complex_normal(generator: np.random.Generator, shape: tuple[int, ...]) -> Any:
    """Circular complex Gaussian numbers of variance 1."""
    return generator.standard_normal((*shape, 2)) @ np.array([1, 1j]) / np.sqrt(2)


def experiments(
    generator: np.random.Generator, trials: int, n_block: int, n_freq: int, n: int, root: ComplexArray
) -> Any:
    """Orthogonal inputs of a block and outputs of a random plant with noise ``root @ root^H`` on each.

    Returns truth (n_freq, n, n), u and y (trials, n_block, n_freq, n, n).
    """
    truth = complex_normal(generator, (n_freq, n, n)) + 4 * np.eye(n)
    phase = np.exp(2j * np.pi * generator.random((trials, n_block, n_freq, n)))
    u = phase[..., None] * orthogonal_matrix(n).T * np.linspace(1.0, 2.0, n)[:, None]
    y = truth @ u + root @ complex_normal(generator, (trials, n_block, n_freq, n, n))
    return truth, u, y


def correlated_root(generator: np.random.Generator, n: int) -> Any:
    """Square root of a noise covariance with strong correlations between outputs."""
    return 0.05 * (np.eye(n) + 0.7 * complex_normal(generator, (n, n)))


def binomial_bounds(trials: int, level: float = 0.95) -> Any:
    """Share of covered trials that chance allows, at odds of one to a million."""
    low, high = np.asarray(stats.binom.ppf([5e-7, 1 - 5e-7], trials, level)) / trials
    return low, high


def resonant(frequency_hz: FloatArray, n: int = 2) -> Any:
    """n coupled motors behind springs: closed form with resonances and antiresonances 20 to 30 dB deep."""
    s = 2j * np.pi * frequency_hz[:, None, None]
    chain = np.eye(n, k=1) + np.eye(n, k=-1)
    stiffness = np.diag(np.linspace(2.2e4, 1.4e4, n)) - 0.8e4 * chain
    arm, motor, zero = (
        np.diag(np.linspace(2.0, 1.2, n)) + 0.2 * chain,
        np.diag(np.linspace(1, 0.6, n)),
        np.zeros((n, n)),
    )
    mass = np.block([[motor, zero], [zero, arm]])
    spring = np.block([[stiffness, -stiffness], [-stiffness, stiffness]])
    return (s**2 * np.linalg.inv(s**2 * mass + spring * (1 + 4e-4 * s)))[:, :n, :n]


@pytest.mark.parametrize(
    ("estimator", "n", "n_block"), [("h1", 6, 2), ("log", 6, 2), ("log", 1, 4), ("h1", 2, 3)]
)
def test_stated_regions_cover_the_truth(estimator: Any, n: int, n_block: int) -> None:
    # Complex 95 % regions with the stated degrees of freedom, on lines at least a window apart. Disturbing
    # torques at -30 dB of the input and noise of the position sensor beside them: the second order of the
    # logarithm is far below the standard error.
    generator = np.random.default_rng(20 + n + n_block)
    frequency = np.geomspace(5, 60, 35)
    trials, n_freq, weight = 200, len(frequency), n * (n_block - 1)
    truth = resonant(frequency, n)
    phase = np.exp(2j * np.pi * generator.random((trials, n_block, n_freq, n)))
    u = phase[..., None] * orthogonal_matrix(n).T * np.linspace(1.0, 2.0, n)[:, None]
    torque = 0.03 * np.linspace(0.5, 2.0, n)[:, None] * complex_normal(generator, u.shape)
    sensor = 0.03 * (frequency / 60)[:, None, None] ** 2 * complex_normal(generator, u.shape)
    y = truth @ (u + torque) + sensor
    joined = sp.side_by_side(u), sp.side_by_side(y)
    factors = sp.factor_inputs(joined[0])
    products = cv.residual_products(*joined, factors.inverse)
    h1, power = joined[1] @ factors.inverse, np.mean(np.abs(joined[1]) ** 2, axis=-1)
    pooled: Any = cv.pool_lines(products, weight, np.ones((trials, n_freq), bool), power, h1, frequency)
    length = 2 * pooled.half_window + 1
    assert (pooled.degrees_of_freedom == length * weight).all()
    if estimator == "h1":
        response, gram_inverse = h1, factors.gram_inverse
    else:
        by_block = sp.factor_inputs(np.moveaxis(u, 1, 0))
        blocks = np.moveaxis(y, 1, 0) @ by_block.inverse
        response = means.logarithmic_mean_matrix(blocks)
        gram_inverse = cv.gram_inverse_of_mean(by_block.gram_inverse)
    noise = np.einsum("tfii->tfi", pooled.covariance).real
    inputs = np.einsum("tfjj->tfj", gram_inverse).real
    radius = cv.confidence_radius(noise[..., :, None] * inputs[..., None, :], np.array(length * weight))
    apart = np.arange(pooled.half_window, n_freq, length)
    covered = (np.abs(response - truth) <= radius)[:, apart].mean(axis=(0, 1))
    low, high = binomial_bounds(trials * len(apart))
    assert (covered >= low).all()
    assert (covered <= high).all()
    # At every line on average over entries, resonances included; entries of one input share their error.
    by_line = (np.abs(response - truth) <= radius).mean(axis=(0, 2, 3))
    low, high = binomial_bounds(trials * n)
    assert (by_line >= low - 0.01).all()
    assert (by_line <= high + 0.01).all()


def test_stated_covariance_is_that_of_the_whole_matrix() -> None:
    # e = vec(G^ - G), column after column, has the covariance conj((U U^H)^-1) (x) C_V: then e^H Lambda^-1 e
    # is half a chi-square of 2 n^2 degrees of freedom: mean n^2, variance n^2. Inputs are strongly correlated and
    # complex, so that a transpose in the wrong place shows.
    generator = np.random.default_rng(2)
    n, n_exp, trials = 2, 5, 4000
    root = np.array([[1.0, 0.0], [0.8j, 0.3]])
    u = np.array([[1.0, 0.0], [0.9j, 0.4]]) @ complex_normal(generator, (1, n, n_exp))
    y = root @ complex_normal(generator, (trials, n, n_exp))
    factors = sp.factor_inputs(u)
    error = (y @ factors.inverse[0]).swapaxes(-1, -2).reshape(trials, -1)
    stated = np.kron(factors.gram_inverse[0].conj(), root @ root.conj().T)
    distance = np.einsum("ti,ij,tj->t", error.conj(), np.linalg.inv(stated), error).real
    assert distance.mean() == pytest.approx(n**2, abs=5 * n / np.sqrt(trials))
    assert distance.var() == pytest.approx(n**2, rel=0.15)
    wrong = np.kron(factors.gram_inverse[0], root @ root.conj().T)
    wrong_distance = np.einsum("ti,ij,tj->t", error.conj(), np.linalg.inv(wrong), error).real
    assert abs(wrong_distance.mean() - n**2) > 20 * n / np.sqrt(trials)


def test_pooled_covariance_is_unbiased_and_that_of_one_experiment() -> None:
    generator = np.random.default_rng(3)
    n, trials, n_freq = 3, 600, 7
    root = correlated_root(generator, n)
    truth, u, y = experiments(generator, trials, 2, n_freq, n, root)
    joined = sp.side_by_side(u), sp.side_by_side(y)
    products = cv.residual_products(*joined, sp.factor_inputs(joined[0]).inverse)
    # Entries of a complex Wishart matrix over nu have the variance C_ii C_jj / nu.
    stated = root @ root.conj().T
    size = np.sqrt(np.outer(np.diag(stated).real, np.diag(stated).real) / (n * n_freq * trials))
    mean = (products.sum(axis=1) / (n * n_freq)).mean(axis=0)
    assert (np.abs(mean - stated) < 6 * size).all()
    # The expected course over the lines is itself estimated, from 7 lines here: worth a percent.
    power, valid = np.ones((trials, n_freq, n)), np.ones((trials, n_freq), bool)
    pooled: Any = cv.pool_lines(
        products, n, valid, power, np.broadcast_to(truth, products.shape), np.ones(n_freq), 3
    )
    deviation = np.abs(pooled.covariance.mean(axis=(0, 1)) - stated)
    assert (deviation < 8 * size + 0.02 * np.abs(stated)).all()


@pytest.mark.parametrize(("torque", "acceleration"), [(1.0, 0.0), (0.0, 1.0), (0.3, 0.1)])
def test_pooling_follows_resonances_and_the_noise_of_the_sensor(torque: float, acceleration: float) -> None:
    # Disturbing torques reach the residual through the response, noise of the position sensor does not: plain
    # averages over neighbouring lines would be wrong by an order of magnitude at the antiresonance.
    generator = np.random.default_rng(9)
    frequency = np.geomspace(5, 60, 50)
    g = resonant(frequency)
    direct = acceleration * (frequency / 60)[:, None, None] ** 2
    weight, trials = 6, 200
    residual = g @ (torque * complex_normal(generator, (trials, 50, 2, weight)))
    residual = residual + direct * complex_normal(generator, (trials, 50, 2, weight))
    products = residual @ residual.conj().swapaxes(-1, -2)
    truth = torque**2 * g @ g.conj().swapaxes(-1, -2) + direct**2 * np.eye(2)
    valid, power = np.ones((trials, 50), bool), np.ones((trials, 50, 2))
    pooled: Any = cv.pool_lines(
        products, weight, valid, power, np.broadcast_to(g, products.shape), frequency, 2
    )
    ratio = np.einsum("tfii->tfi", pooled.covariance).real.mean(axis=0) / np.einsum("fii->fi", truth).real
    # Mean over 200 trials of 30 degrees of freedom: 1.3 %; four of these, and 10 % for the fitted course.
    assert np.abs(ratio - 1).max() < 0.15
    length = np.stack([np.roll(np.einsum("fii->fi", truth).real, k, axis=0) for k in range(-2, 3)])
    plain = length.mean(axis=0) / np.einsum("fii->fi", truth).real
    assert torque == 0.0 or plain[2:-2].max() > 3


def test_scatter_of_unequal_blocks_is_unbiased() -> None:
    generator = np.random.default_rng(4)
    n, n_block, trials = 3, 4, 4000
    root = correlated_root(generator, n)
    u = complex_normal(generator, (n_block, 1, n, n)) + 3 * np.eye(n)
    u *= np.array([1.0, 0.5, 2.0, 1.5])[:, None, None, None]
    y = root @ complex_normal(generator, (n_block, trials, n, n))
    factors = sp.factor_inputs(u)
    blocks = y @ factors.inverse
    gram_inverse = np.broadcast_to(factors.gram_inverse, blocks.shape)
    products = cv.block_products(blocks, gram_inverse) / ((n_block - 1) * n)
    truth = root @ root.conj().T
    deviation = products.reshape(trials, -1).std(axis=0).reshape(n, n) / np.sqrt(trials)
    assert (np.abs(products.mean(axis=0) - truth) < 5 * deviation).all()
    # And the mean of the blocks has the Gram matrix that is stated for it.
    variance = np.mean(np.abs(blocks.mean(axis=0)) ** 2, axis=0)
    stated = np.outer(np.diag(truth).real, np.diag(cv.gram_inverse_of_mean(factors.gram_inverse)[0]).real)
    assert variance == pytest.approx(stated, rel=6 / np.sqrt(trials))


def test_equal_blocks_give_what_least_squares_gives() -> None:
    generator = np.random.default_rng(5)
    _, u, y = experiments(generator, 3, 4, 2, 3, correlated_root(generator, 3))
    by_block = sp.factor_inputs(np.moveaxis(u, 1, 0))
    joined = sp.factor_inputs(sp.side_by_side(u))
    assert cv.gram_inverse_of_mean(by_block.gram_inverse) == pytest.approx(joined.gram_inverse, abs=1e-14)
    scatter = cv.block_products(np.moveaxis(y, 1, 0) @ by_block.inverse, by_block.gram_inverse)
    assert scatter == pytest.approx(
        cv.residual_products(sp.side_by_side(u), sp.side_by_side(y), joined.inverse)
    )


def test_differences_between_periods_show_the_noise_and_nothing_periodic() -> None:
    generator = np.random.default_rng(6)
    n, n_exp, n_period, n_freq = 2, 4, 3, 4000
    response = complex_normal(generator, (n_freq, n, n))
    u = complex_normal(generator, (n_freq, n, n_exp, 1)) * np.ones(n_period)
    distortion = complex_normal(generator, (n_freq, n, n_exp, 1))  # the same in every period
    root = correlated_root(generator, n)
    noise = np.einsum("ij,fjep->fiep", root, complex_normal(generator, (n_freq, n, n_exp, n_period)))
    y = np.einsum("fij,fjep->fiep", response, u) + distortion + noise
    products = cv.period_products(u, y, response).mean(axis=0) / ((n_period - 1) * n_exp)
    truth = root @ root.conj().T / n_period  # of the average over periods
    size = np.sqrt(np.outer(np.diag(truth).real, np.diag(truth).real) / ((n_period - 1) * n_exp * n_freq))
    assert (np.abs(products - truth) < 6 * size).all()


def pooled_flat(products: Any, weight: int, valid: BoolArray, half_window: int | None = None) -> Any:
    """Pool with a response that is the same at every line."""
    n = products.shape[-1]
    response = np.broadcast_to(np.eye(n) + 0j, products.shape)
    power = np.full(products.shape[:-1], 1e4)
    return cv.pool_lines(
        products, weight, valid, power, response, np.linspace(5, 6, products.shape[1]), half_window
    )


def test_covariance_is_positive_definite_even_without_noise() -> None:
    n_freq, n = 9, 3
    for products in (np.zeros((1, n_freq, n, n)), np.ones((1, n_freq, n, n))):  # none; perfectly correlated
        pooled = pooled_flat(products + 0j, 3, np.ones((1, n_freq), bool))
        np.linalg.cholesky(pooled.covariance)
        assert np.abs(pooled.covariance - products / 3).max() < 0.02  # the fitted course is not quite flat


def test_window_has_the_same_number_of_valid_lines_everywhere() -> None:
    n_freq = 12
    valid = np.ones((1, n_freq), dtype=bool)
    valid[0, [0, 5, 6]] = False
    # The entry beside the diagonal marks the line; the diagonal, which gives the course, is the same everywhere.
    mark = 0.01 * np.arange(n_freq)
    products = np.broadcast_to(np.eye(2) + 0j, (1, n_freq, 2, 2)).copy()
    products[0, :, 0, 1] = products[0, :, 1, 0] = mark
    products[~valid] = np.nan
    pooled = pooled_flat(products, 2, valid, 1)
    assert pooled.degrees_of_freedom[0].tolist() == [0, 6, 6, 6, 6, 0, 0, 6, 6, 6, 6, 6]
    # Line 4 has the neighbours 3 and 7, line 1 at the end leans on 2 and 3.
    assert pooled.covariance[0, 4, 0, 1] == pytest.approx((mark[3] + mark[4] + mark[7]) / 6, rel=0.05)
    assert pooled.covariance[0, 1, 0, 1] == pytest.approx((mark[1] + mark[2] + mark[3]) / 6, rel=0.05)
    assert np.isnan(pooled.covariance[0, 5]).all()
    assert products[0, 1, 0, 0] == 1.0  # what was handed in is untouched


def test_a_covariance_below_full_rank_is_not_stated() -> None:
    eye = np.broadcast_to(np.eye(6) + 0j, (1, 4, 6, 6))
    assert pooled_flat(eye, 1, np.ones((1, 4), bool)) is None  # 4 residuals, 6 outputs
    assert pooled_flat(eye, 6, np.zeros((1, 4), bool)) is None
    assert pooled_flat(eye, 2, np.ones((1, 4), bool)) is not None


@pytest.mark.parametrize(
    ("weight", "n_out", "half"), [(6, 6, 2), (18, 6, 2), (1, 1, 2), (1, 6, 12), (2, 6, 6)]
)
def test_default_window_reaches_four_degrees_of_freedom_per_output(
    weight: int, n_out: int, half: int
) -> None:
    assert cv.default_half_window(weight, n_out) == half
    assert (2 * half + 1) * weight >= 4 * n_out


def test_confidence_radius_is_the_quantile_of_f() -> None:
    for freedom in (1.0, 3.0, 30.0, 1e6):
        expected = np.sqrt(2.0 * stats.f.ppf(0.95, 2, 2 * freedom))
        assert cv.confidence_radius(np.array(2.0), np.array(freedom)) == pytest.approx(expected, rel=1e-6)
    assert cv.confidence_radius(np.array(1.0), np.array(3.0)) ** 2 == pytest.approx(5.14, abs=0.005)
