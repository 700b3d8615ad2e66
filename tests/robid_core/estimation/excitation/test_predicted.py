"""Predicted standard deviations against brute force: noise drawn, spectra made of it, responses estimated."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.excitation.predicted import SensorNoise, noise_covariance, predicted_deviation
from robid_core.estimation.response.spectra import response_from_spectra

N_AXIS, N_FREQ, N_SAMPLE = 2, 12, 400
FREQUENCY = np.linspace(4.0, 30.0, N_FREQ)
OMEGA_SQUARED = (2 * np.pi * FREQUENCY) ** 2
DISTORTION = np.array([0.02, 0.05])  # N m, rms of the DFT coefficient
NOISE = SensorNoise(np.array([2e-5, 5e-5]) ** 2, np.array([0.1, 0.04]) ** 2, np.zeros(2))


def plant() -> np.ndarray:
    """Return two masses with one coupling and a resonance, (n_freq, 2, 2)."""
    resonance = 1 / (1 - (FREQUENCY / 15.0) ** 2 + 0.1j * FREQUENCY / 15.0)
    shape = np.array([[80.0, 15.0], [15.0, 200.0]])
    response: np.ndarray = shape * resonance[:, None, None] + 30.0 * np.eye(2)
    return response


def circular(generator: np.random.Generator, shape: tuple[int, ...], rms: np.ndarray | float) -> np.ndarray:
    """Draw complex normal numbers, `rms` along the axes of the robot (second to last)."""
    pair = generator.standard_normal((2, *shape))
    drawn: np.ndarray = np.asarray(rms) * (pair[0] + 1j * pair[1]) / np.sqrt(2)
    return drawn


def test_noise_of_the_sensors_is_the_scatter_of_transformed_samples() -> None:
    generator, n_draw, bins = np.random.default_rng(1), 4000, np.array([10, 60])
    omega_squared = (2 * np.pi * bins / (N_SAMPLE * 1e-3)) ** 2
    g = plant()[:2]
    angle = generator.standard_normal((n_draw, N_SAMPLE, 2)) * np.sqrt(NOISE.position)
    torque = generator.standard_normal((n_draw, N_SAMPLE, 2)) * np.sqrt(NOISE.torque)
    angle_lines, torque_lines = (np.fft.fft(x, axis=1)[:, bins] / N_SAMPLE for x in (angle, torque))
    v = -omega_squared[:, None] * angle_lines - np.einsum("kij,nkj->nki", g, torque_lines)
    found = np.einsum("nki,nkj->kij", v, v.conj()) / n_draw
    expected = noise_covariance(g, bins / (N_SAMPLE * 1e-3), NOISE.position, NOISE.torque, N_SAMPLE)
    # An entry scatters by sqrt(C_ii C_jj / n_draw), 1.6 % of the diagonal; five times that.
    size = np.sqrt(np.einsum("kii,kjj->kij", expected, expected).real)
    assert (np.abs(found - expected) < 0.08 * size).all()


def test_predicted_deviation_is_the_scatter_of_h1_over_many_measurements() -> None:
    generator, n_planned, n_more, n_draw = np.random.default_rng(2), 4, 60, 1500
    g = plant()

    def distortion(*shape: int) -> np.ndarray:
        return circular(generator, (*shape, N_FREQ, N_AXIS, n_planned), DISTORTION[:, None])

    u = circular(generator, (N_FREQ, N_AXIS, n_planned + n_more), 0.6)
    d = circular(generator, (N_FREQ, N_AXIS, n_planned + n_more), DISTORTION[:, None])
    predicted = predicted_deviation(u, g @ (u + d), n_planned, FREQUENCY, NOISE, N_SAMPLE)
    assert predicted is not None
    planned = u[..., :n_planned]
    angle = circular(
        generator,
        (n_draw, N_FREQ, N_AXIS, n_planned),
        OMEGA_SQUARED[:, None, None] * np.sqrt(NOISE.position / N_SAMPLE)[:, None],
    )
    torque = circular(generator, angle.shape, np.sqrt(NOISE.torque / N_SAMPLE)[:, None])

    def scatter(disturbance: np.ndarray) -> np.ndarray:
        estimates = response_from_spectra(
            np.broadcast_to(planned, angle.shape), g @ (planned + disturbance - torque) + angle
        )
        variance = np.mean(np.abs(estimates - g) ** 2, axis=0)
        deviation: np.ndarray = np.sqrt(np.einsum("kaa->ka", variance)) / np.abs(np.einsum("kaa->ka", g))
        return deviation

    # The predicted covariance has 62 x 5 degrees of freedom (60 to spare, 5 lines): its deviation is off by
    # 1 / (2 sqrt(310)) = 3 %; a relative size of G from 64 experiments by less, the brute force by 1 / (2 sqrt(1500)) =
    # 1.3 %. Four times the root of their squares.
    assert predicted.total == pytest.approx(scatter(distortion(n_draw)), rel=0.15)
    # Without distortion only the size of G and the brute force are uncertain.
    assert predicted.noise == pytest.approx(scatter(np.zeros(1)), rel=0.08)
    assert (predicted.noise < predicted.total).all()


def test_steps_of_the_encoder_count_as_noise_and_are_not_added_to_residuals_that_hold_them() -> None:
    generator = np.random.default_rng(3)
    u = circular(generator, (N_FREQ, N_AXIS, 8), 1.0)
    y = plant() @ (u + circular(generator, u.shape, 0.01))
    steps = SensorNoise(np.zeros(2), np.zeros(2), np.full(2, 1e-8))
    none = SensorNoise(np.zeros(2), np.zeros(2), np.zeros(2))
    with_steps, without = (predicted_deviation(u, y, 8, FREQUENCY, x, N_SAMPLE) for x in (steps, none))
    assert with_steps is not None
    assert without is not None
    assert with_steps.total == pytest.approx(without.total)
    assert (with_steps.noise > 0).all()
    assert (without.noise == 0).all()


def test_what_averages_cannot_give_is_not_predicted() -> None:
    generator = np.random.default_rng(4)
    u = circular(generator, (N_FREQ, N_AXIS, 6), 1.0)
    y = plant() @ u
    assert predicted_deviation(u, y, 1, FREQUENCY, NOISE, N_SAMPLE) is None  # fewer experiments than axes
    assert predicted_deviation(u[..., :2], y[..., :2], 2, FREQUENCY, NOISE, N_SAMPLE) is None  # none to spare


def test_a_line_that_is_not_excited_has_no_deviation_and_leaves_the_others_theirs() -> None:
    generator = np.random.default_rng(5)
    u = circular(generator, (N_FREQ, N_AXIS, 6), 1.0)
    u[4, 1] = u[4, 0]  # both motors do the same there
    y = plant() @ (u + circular(generator, u.shape, 0.01))
    found = predicted_deviation(u, y, 6, FREQUENCY, NOISE, N_SAMPLE)
    assert found is not None
    assert np.isnan(found.total[4]).all()
    assert np.isfinite(np.delete(found.total, 4, axis=0)).all()
