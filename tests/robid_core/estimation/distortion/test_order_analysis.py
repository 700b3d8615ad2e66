"""Waves of the angle against integrals, Bessel functions and a motor written down in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import jv

from robid_core.estimation.distortion.order_analysis import (
    KINDS,
    MotorData,
    compensated,
    deviation_of,
    friction_columns,
    motors_of,
    residuals,
    ripple_columns,
    speed_in_steps,
    stacked,
    wave_at_samples,
    wave_over_steps,
)

N, STEP = 400, 0.005
LINE, BINS = np.arange(5, 60, 2), np.arange(5, 60)
TIME = np.arange(N) * STEP


def motor(angle: np.ndarray, torque: np.ndarray, held: bool = False) -> MotorData:
    return motors_of(angle[:, None, :, None], torque[:, None, :, None], LINE, BINS, STEP, held)[0]


def swinging(n_exp: int = 4, seed: int = 0) -> np.ndarray:
    """A slow sine on bin 2 and a multisine of 28 lines, about a turn."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, (n_exp, 1, len(LINE)))
    slow = 3.0 * np.sin(2 * np.pi * 2 * TIME / (N * STEP) + rng.uniform(0, 6.28, (n_exp, 1)))
    return slow + np.sum(0.3 / LINE * np.cos(2 * np.pi * TIME[:, None] * LINE / (N * STEP) + phase), axis=-1)


def test_a_held_torque_meets_the_mean_of_the_wave_over_the_step() -> None:
    angle = np.array([0.3, 0.7, 0.1, 0.3])
    cosine, sine = wave_over_steps(angle, 9.0)
    for k in range(4):
        rise = angle[(k + 1) % 4] - angle[k]
        mean = [
            quad(lambda s, f=f, k=k, rise=rise: f(9.0 * (angle[k] + rise * s)), 0, 1)[0]
            for f in (np.cos, np.sin)
        ]
        assert (cosine[k], sine[k]) == pytest.approx(mean, abs=1e-12)


def test_the_spectrum_of_a_wave_under_a_slow_sine_is_that_of_bessel() -> None:
    """cos(n A sin(w t)) = J_0 + 2 sum J_2k cos(2 k w t), sin(n A sin) = 2 sum J_(2k+1) sin((2k+1) w t)."""
    angle = np.tile(1.5 * np.sin(2 * np.pi * TIME / (N * STEP)), (2, 1)) * np.array([[1.0], [0.5]])
    data = motor(angle + 1e-3 * swinging(2), np.ones((2, N)))
    exact = MotorData(angle, data.torque, BINS, STEP, False, data.basis, data.inertia)
    (columns,) = ripple_columns(exact, 6.0, ("cogging",))
    for experiment, depth in enumerate((9.0, 4.5)):
        for k, number in enumerate(BINS):
            even = -jv(number, depth) if number % 2 == 0 else 0.0
            odd = 1j * jv(number, depth) if number % 2 else 0.0
            np.testing.assert_allclose(columns[experiment, k], [even, odd], atol=1e-13)


@pytest.mark.parametrize("held", [False, True])
def test_speed_is_exact_for_a_multisine_at_the_instants_inside_a_step(held: bool) -> None:
    omega = 2 * np.pi * np.array([2, 30]) / (N * STEP)
    data = motor(swinging(2), np.ones((2, N)), held)
    angle = np.tile(np.sin(omega[0] * TIME) + 0.1 * np.cos(omega[1] * TIME), (2, 1))
    data = MotorData(angle, data.torque, BINS, STEP, held, data.basis, data.inertia)
    speed = speed_in_steps(data)
    inside = (np.arange(4) + 0.5) / 4 * STEP if held else np.zeros(1)
    t = TIME[:, None] + inside
    expected = omega[0] * np.cos(omega[0] * t) - 0.1 * omega[1] * np.sin(omega[1] * t)
    np.testing.assert_allclose(speed[0], expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("kind", KINDS)
def test_one_unit_of_a_wave_changes_the_torque_of_a_rigid_motor_by_its_column(kind: str) -> None:
    """u = J q'' - d with q = p - e: the columns are the differences of u at the same measured angle p."""
    inertia, order, size = 2e-3, 3.0, {"cogging": 0.2, "current": 0.05, "resolver": 1e-3}[kind]
    angle = swinging()
    omega = 2 * np.pi * np.fft.rfftfreq(N, STEP)

    def acceleration(x: np.ndarray) -> np.ndarray:
        return np.asarray(np.fft.irfft(-(omega**2) * np.fft.rfft(x, axis=-1), N, axis=-1))

    plain = inertia * acceleration(angle)
    sine = wave_at_samples(angle, order)[1]
    changed = {
        "cogging": plain - size * sine,
        "current": plain / (1 + size * sine),
        "resolver": inertia * acceleration(angle - size * sine),
    }[kind]
    data = motor(angle, changed)
    straight = MotorData(angle, changed, BINS, STEP, False, data.basis, np.full(len(BINS), inertia + 0j))
    (columns,) = ripple_columns(straight, order, (kind,))  # type: ignore[arg-type]
    difference = data.spectrum(changed) - data.spectrum(plain)
    np.testing.assert_allclose(size * columns[..., 1], difference, atol=1e-9 * np.abs(difference).max())
    true_angle, acting = compensated(angle, changed, [((kind, order), 0.0, size)], False)  # type: ignore[list-item]
    left = data.spectrum(inertia * acceleration(true_angle) - acting)
    assert np.abs(left).max() < 1e-9 * np.abs(difference).max()


def test_columns_come_in_the_order_asked_for() -> None:
    data = motor(swinging(), np.random.default_rng(1).standard_normal((4, N)))
    waves = (("resolver", 2.0), ("cogging", 3.0), ("current", 2.0), ("cogging", 2.0))
    together = residuals(data, waves)  # type: ignore[arg-type]
    for number, wave in enumerate(waves):
        alone = residuals(data, (wave,))  # type: ignore[arg-type]
        np.testing.assert_array_equal(together[..., 2 * number : 2 * number + 2], alone)


def test_coulomb_friction_of_a_held_torque_lies_in_the_friction_columns() -> None:
    """Friction 0.5 tanh(v / s) averaged over each step; taken at the samples, a tenth of it would be left."""
    angle = swinging()
    data = motor(angle, np.ones((4, N)), held=True)
    fine = speed_in_steps(data)
    friction = 0.5 * np.tanh(fine / (0.1 * np.sqrt(np.mean(fine**2)))).mean(axis=-1)
    rows = stacked(friction_columns(data), np.ones(len(BINS)))
    target = stacked(data.spectrum(friction)[..., None], np.ones(len(BINS)))[:, 0]
    left = target - rows @ np.linalg.lstsq(rows, target)[0]
    assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(target)
    early = MotorData(angle, data.torque, BINS, STEP, False, data.basis, data.inertia)
    rows = stacked(friction_columns(early), np.ones(len(BINS)))
    left = target - rows @ np.linalg.lstsq(rows, target)[0]
    assert np.linalg.norm(left) > 0.05 * np.linalg.norm(target)


def test_odd_even_and_excited_bins_have_deviations_of_their_own() -> None:
    line = np.arange(5, 60, 4)
    angle = swinging(40)
    data = motors_of(angle[:, None, :, None], angle[:, None, :, None], line, BINS, STEP, False)[0]
    excited = np.isin(BINS, line)
    size = np.where(excited, 3.0, np.where(BINS % 2 == 0, 2.0, 1.0))
    rng = np.random.default_rng(2)
    residual = (
        size * (rng.standard_normal((40, len(BINS))) + 1j * rng.standard_normal((40, len(BINS)))) / np.sqrt(2)
    )
    # At lines a real residual has one experiment less; 40 experiments of 9 bins and more: 0.5 / sqrt(360), five of it.
    expected = size * np.sqrt(np.where(excited, 40 / 39, 1.0))
    np.testing.assert_allclose(deviation_of(residual, data), expected, rtol=5 * 0.5 / np.sqrt(360))


def test_stacked_rows_of_circular_noise_have_unit_variance() -> None:
    rng = np.random.default_rng(3)
    noise = 3.0 * (rng.standard_normal((500, 8, 1)) + 1j * rng.standard_normal((500, 8, 1))) / np.sqrt(2)
    rows = stacked(noise, np.full(8, 3.0))
    assert rows.shape == (8000, 1)
    assert np.mean(rows**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / 8000))
