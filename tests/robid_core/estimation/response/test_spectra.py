"""Responses from spectra: closed-form plants, an oracle with SciPy's matrix functions, and bad inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.special import exp1

from robid_core import ComplexArray
from robid_core.errors import DataRejected, PoorExcitation
from robid_core.estimation.excitation.multisine import orthogonal_matrix
from robid_core.estimation.response import means, spectra as sp

FREQUENCY_HZ = np.geomspace(4, 80, 15)


def plant(n: int) -> Any:
    """Motor torque to motor acceleration of n coupled motors behind springs: symmetric, entries of both signs.

    Closed form ``(i w)^2 (K + i w D - w^2 M)^-1``, motor coordinates of 2 n.
    """
    generator = np.random.default_rng(10 + n)
    root = generator.standard_normal((n, n))
    arm = 2 * np.eye(n) + 0.5 * (root @ root.T) / n + 0.8 * (np.eye(n, k=1) + np.eye(n, k=-1))
    stiffness = np.diag(np.linspace(2e3, 4e4, n))
    zero = np.zeros((n, n))
    mass = np.block([[np.diag(np.linspace(1.0, 0.5, n)), zero], [zero, arm]])
    spring = np.block([[stiffness, -stiffness], [-stiffness, stiffness]])
    s = 2j * np.pi * FREQUENCY_HZ[:, None, None]
    g = s**2 * np.linalg.inv(s**2 * mass + (1 + 5e-4 * s) * spring)
    return g[:, :n, :n]


def inputs(generator: np.random.Generator, n_block: int, n: int) -> Any:
    """Orthogonal random-phase inputs, shape (n_block, n_freq, n, n)."""
    phase = np.exp(2j * np.pi * generator.random((n_block, len(FREQUENCY_HZ), n)))
    return 0.3 * phase[..., None] * orthogonal_matrix(n).T


def relative(error: ComplexArray, truth: ComplexArray) -> Any:
    """Error as a share of the largest entry at the line."""
    return np.max(np.abs(error) / np.abs(truth).max(axis=(-2, -1), keepdims=True))


@pytest.mark.parametrize("n", [1, 2, 6])
def test_known_plant_is_recovered(n: int) -> None:
    g, u = plant(n), inputs(np.random.default_rng(n), 3, n)
    y = g @ u
    if n == 6:  # what makes the logarithm hard
        assert (g.real < 0).any()
        assert np.abs(g - g.swapaxes(-1, -2)).max() < 1e-12 * np.abs(g).max()
    joined = sp.response_from_spectra(sp.side_by_side(u), sp.side_by_side(y))
    blocks = sp.response_from_spectra(u, y)
    for estimate in (
        joined,
        blocks[1],
        means.logarithmic_mean_matrix(blocks),
        means.logarithmic_mean_entries(blocks),
    ):
        assert relative(estimate - g, g) < 1e-10


def test_least_squares_is_the_formula_of_the_thesis() -> None:
    generator = np.random.default_rng(5)
    u = generator.standard_normal((4, 3, 8)) + 1j * generator.standard_normal((4, 3, 8))
    y = generator.standard_normal((4, 3, 8)) + 1j * generator.standard_normal((4, 3, 8))
    for k in range(4):
        expected = y[k] @ u[k].conj().T @ np.linalg.inv(u[k] @ u[k].conj().T)  # (3.7)
        assert sp.response_from_spectra(u, y)[k] == pytest.approx(expected, rel=1e-10)
        gram_inverse = np.linalg.inv(u[k] @ u[k].conj().T)
        assert sp.factor_inputs(u).gram_inverse[k] == pytest.approx(gram_inverse, rel=1e-10)


def thesis_logarithm(blocks: ComplexArray) -> Any:
    """(3.12) and (3.13) written down for one line, with SciPy's matrix functions."""
    value, vector = np.linalg.eig(blocks[0])
    p = vector @ np.diag(np.exp(-1j * np.angle(value))) @ np.linalg.inv(vector)
    return np.linalg.inv(p) @ expm(np.mean([logm(p @ block) for block in blocks], axis=0))


def test_matrix_logarithm_agrees_with_scipy_line_by_line() -> None:
    g = plant(6)
    generator = np.random.default_rng(8)
    noise = generator.standard_normal((4, *g.shape)) + 1j * generator.standard_normal((4, *g.shape))
    blocks = g * (1 + 0.1 * noise)
    estimate = means.logarithmic_mean_matrix(blocks)
    for k in range(len(g)):
        assert relative(estimate[k] - thesis_logarithm(blocks[:, k]), g[k]) < 1e-9
    # Both forms are averages of the same blocks: apart by the second order of the noise, not by the first.
    assert np.median(np.abs(estimate - means.logarithmic_mean_entries(blocks)) / np.abs(g)) < 0.02


def test_logarithm_entry_by_entry_after_p_would_be_wrong() -> None:
    # Why the logarithm is one of matrices: with P the entries are not close to real and positive.
    g = plant(6)
    value, vector = np.linalg.eig(g)
    p = (vector * np.exp(-1j * np.angle(value))[..., None, :]) @ np.linalg.inv(vector)
    angle = np.angle(p @ g)
    assert np.abs(angle).max() > np.pi / 2
    assert relative(means.logarithmic_mean_matrix(np.stack([g, g])) - g, g) < 1e-10


def test_matrices_without_independent_eigenvectors_are_averaged_too() -> None:
    defective = np.array([[2.0, 1.0], [0.0, 2.0]]) * np.exp(0.7j)
    blocks = np.stack([defective, defective])[:, None]
    assert means.logarithmic_mean_matrix(blocks)[0] == pytest.approx(defective, rel=1e-9)


def test_diagonal_responses_have_the_geometric_mean_in_both_forms() -> None:
    magnitude, phase = np.array([[1.0, 5.0], [4.0, 20.0]]), np.array([[3.0, 0.2], [3.4, 0.4]])
    blocks = np.zeros((2, 1, 2, 2), dtype=complex)
    blocks[:, 0, [0, 1], [0, 1]] = magnitude * np.exp(1j * phase)
    expected = np.diag([2 * np.exp(3.2j), 10 * np.exp(0.3j)])  # 3.0 and 3.4 rad lie on both sides of pi
    assert means.logarithmic_mean_matrix(blocks)[0] == pytest.approx(expected)
    assert means.logarithmic_mean_entries(blocks)[0] == pytest.approx(expected)  # zeros stay zeros


@pytest.mark.parametrize("snr", [0.5, 1.0, 2.0, 4.0])
def test_logarithmic_amplitude_is_biased_as_theory_says(snr: float) -> None:
    # log|g + n| of complex Gaussian noise of power |g|^2 / S has the mean log|g| + E1(S) / 2. The standard
    # deviation of log|g + n| is below pi / sqrt(24) = 0.64, its value without any g, hence five times
    # 0.64 / sqrt(200 000) = 0.0072 for the mean.
    generator = np.random.default_rng(4)
    noise = generator.standard_normal((200_000, 2)) @ np.array([1, 1j]) * np.sqrt(0.5 / snr)
    g = 2.0 * np.exp(2.5j)
    mean = means.logarithmic_mean_entries((g * (1 + noise))[:, None])
    assert np.log(np.abs(mean[0]) / 2.0) == pytest.approx(exp1(snr) / 2, abs=5 * 0.64 / np.sqrt(200_000))
    matrix = means.logarithmic_mean_matrix((g * (1 + noise[:2000]))[:, None, None, None])
    assert np.abs(matrix[0, 0, 0]) == pytest.approx(np.exp(np.log(np.abs(g * (1 + noise[:2000]))).mean()))


def test_entries_that_drown_in_noise_take_the_arithmetic_mean() -> None:
    generator = np.random.default_rng(6)
    blocks = generator.standard_normal((4, 3, 2, 2)) + 1j * generator.standard_normal((4, 3, 2, 2))
    blocks[:, :, 0, 0] += 50.0
    deviation = np.full((3, 2, 2), np.sqrt(2.0))
    mean = means.logarithmic_mean_entries(blocks, deviation)
    small = np.abs(blocks.mean(axis=0)) < 2 * np.sqrt(2.0)
    assert small[:, [0, 1, 1], [1, 0, 1]].mean() > 0.8
    assert not small[:, 0, 0].any()
    assert (mean[small] == blocks.mean(axis=0)[small]).all()
    assert mean[0, 0, 0] == pytest.approx(
        blocks[0, 0, 0, 0] * np.exp(np.log(blocks[:, 0, 0, 0] / blocks[0, 0, 0, 0]).mean())
    )


def test_a_line_without_input_is_told_and_spares_the_others() -> None:
    g, u = plant(2), inputs(np.random.default_rng(2), 1, 2)[0]
    u[7, 1] = 0.0
    factors = sp.factor_inputs(u)
    good = np.arange(len(u)) != 7
    assert np.isinf(factors.condition[7])
    assert np.isnan(factors.inverse[7]).all()
    assert np.isnan(factors.gram_inverse[7]).all()
    assert relative(((g @ u) @ factors.inverse - g)[good], g[good]) < 1e-12
    with pytest.raises(PoorExcitation, match=rf"at {FREQUENCY_HZ[7]:.4g} Hz has condition number inf"):
        sp.response_from_spectra(u, g @ u, FREQUENCY_HZ)
    blocks = np.where(good[:, None, None], g, np.nan)[None]
    assert (np.isnan(means.logarithmic_mean_matrix(blocks)).any(axis=(1, 2)) == ~good).all()


@pytest.mark.parametrize(("singular", "raises"), [(1e-5, False), (1e-7, True), (1e-17, True)])
def test_nearly_singular_inputs_are_refused_by_their_condition_number(singular: float, raises: bool) -> None:
    # np.linalg.solve would return numbers of size 1e14 at 1e-17 without a word.
    rotation = np.linalg.qr(np.random.default_rng(3).standard_normal((2, 2)))[0]
    u = np.stack([np.eye(2), rotation @ np.diag([1, singular]) @ rotation.T]) + 0j
    if not raises:
        assert sp.response_from_spectra(u, 3 * u) == pytest.approx(np.stack([3 * np.eye(2)] * 2), abs=1e-9)
        return
    with pytest.raises(PoorExcitation, match="line 1 has condition number"):
        sp.response_from_spectra(u, 3 * u)


def test_units_of_the_axes_do_not_change_what_is_masked() -> None:
    u = inputs(np.random.default_rng(2), 1, 3)[0]
    u[4, 2] *= 1e-3
    scaled = u * np.array([1e4, 1.0, 1e-4])[:, None]
    assert sp.factor_inputs(scaled).condition == pytest.approx(sp.factor_inputs(u).condition, rel=1e-6)
    # Below the limit the condition number is only bounded; above it is exact.
    exact = sp.factor_inputs(u, 900.0).condition[4]
    assert exact == pytest.approx(1e3 * np.sqrt((14 + 1e-6) / 15), rel=1e-2)
    assert exact <= sp.factor_inputs(u).condition[4] <= 3 * exact


def test_not_a_number_is_named_and_too_few_experiments_are_refused() -> None:
    g, u = plant(2), inputs(np.random.default_rng(2), 1, 2)[0]
    y = g @ u
    y[3, 1, 0] = np.nan
    with pytest.raises(DataRejected, match="output spectrum .* line 4, axis 2, experiment 1"):
        sp.response_from_spectra(u, y)
    u[2, 0, 1] = np.inf
    with pytest.raises(DataRejected, match="input spectrum .* line 3, axis 1, experiment 2"):
        sp.response_from_spectra(u, g @ np.ones_like(u))
    with pytest.raises(PoorExcitation, match="1 experiment cannot separate 2 inputs"):
        sp.factor_inputs(np.ones((5, 2, 1), dtype=complex))


def test_more_than_a_tenth_of_masked_lines_is_poor_excitation() -> None:
    valid = np.ones((2, 20), dtype=bool)
    valid[1, [3, 5]] = False
    sp.refuse_masked(valid, np.arange(1.0, 21.0))
    valid[1, 9] = False
    with pytest.raises(PoorExcitation, match="configuration 2: 3 of 20 lines are masked, from 4 to 10 Hz"):
        sp.refuse_masked(valid, np.arange(1.0, 21.0))
