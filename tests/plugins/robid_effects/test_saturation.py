"""Saturation: exact ramps, and the equivalent gains against draws and simulated sines."""

import itertools

import numpy as np
import pytest

from robid_core import Motion
from robid_effects.saturation import FULL, Saturation, limit_gain, rate_gain, rate_limited_sine


def test_a_high_rate_leaves_the_limit_alone(at, through) -> None:
    command = np.array([0.5, 7.0, -9.0, 3.0, -5.0])
    out = through(Saturation, command, at("torque"), limit=5.0, rate=1e9)
    # a jump of 10 N m at 1e9 N m/s takes 1e-8 s of the step of 2.5e-4 s: half its area is 2e-4 N m
    np.testing.assert_allclose(out, np.clip(command, -5, 5), atol=2.1e-4)


def test_the_ramp_is_its_mean_over_the_step(at, through) -> None:
    """Against the ramp on 400 points a step; the kink where it arrives costs rate dt^2 / (8 step) = 5e-6."""
    rate, step, fine = 8e3, 2.5e-4, 400
    command = np.repeat(3 * np.random.default_rng(6).standard_normal(12), 4)
    out = through(Saturation, command, at("torque"), limit=4.0, rate=rate)
    torque, expected = np.clip(command[0], -4, 4), []
    for target in np.clip(command, -4, 4):
        piece = [torque]
        for _ in range(fine):
            torque += np.clip(target - torque, -rate * step / fine, rate * step / fine)
            piece.append(torque)
        expected.append(np.trapezoid(piece) / fine)
    np.testing.assert_allclose(out, expected, atol=1e-5)
    assert np.abs(np.diff(out)).max() <= rate * step * (1 + 1e-12)


def test_a_finer_step_gives_the_same_torque(at, through) -> None:
    command = np.repeat(3 * np.random.default_rng(7).standard_normal(8), 4)
    coarse = through(Saturation, command, at("torque"), limit=4.0, rate=6e3)
    fine = through(Saturation, np.repeat(command, 8), at("torque", step=2.5e-4 / 8), limit=4.0, rate=6e3)
    np.testing.assert_allclose(fine.reshape(-1, 8).mean(axis=1), coarse, atol=1e-13)


def test_it_starts_at_its_first_command_cut_at_the_limit(at, through) -> None:
    out = through(Saturation, np.full(3, 30.0), at("torque"), limit=20.0, rate=1.0)
    np.testing.assert_array_equal(out, 20.0)


def test_the_gain_of_the_limit_is_that_of_many_draws() -> None:
    """E[slope] by the covariance with the Gaussian part (Stein), 400 000 draws, 5 standard errors."""
    rng = np.random.default_rng(8)
    gaussian = rng.standard_normal(400_000)
    for mean, rms in ((0.0, 0.5), (0.0, 3.0), (1.5, 2.0), (-6.0, 2.0)):
        products = np.clip(mean + rms * gaussian, -4, 4) * gaussian / rms
        error = products.std() / np.sqrt(len(products))
        assert float(limit_gain(4.0, mean, rms)) == pytest.approx(products.mean(), abs=5 * error)
    assert float(limit_gain(4.0, 0.0, 0.0)) == 1
    assert float(limit_gain(4.0, 5.0, 0.0)) == 0


def test_a_rate_limited_sine_has_the_simulated_line(at, through) -> None:
    """800 steps a period, eighth period: a held command is late by half a step, 2 pi / 1600 of its size."""
    n, step = 800, 2.5e-4
    omega = 2 * np.pi / (n * step)
    sine = np.sin(2 * np.pi * np.arange(8 * n) / n)
    for slope in (0.7, 1.2, 1.7, 2.5, 8.0):
        out = through(Saturation, sine, at("torque"), limit=9.0, rate=omega / slope)[-n:]
        line = np.fft.rfft(out)[1] / np.fft.rfft(sine[-n:])[1]
        assert abs(rate_limited_sine(np.array([slope]))[0] - line) < np.pi / n


def test_a_steep_sine_comes_out_as_a_triangle() -> None:
    """Triangle of slope R and period 2 pi / w: fundamental 8 / pi^2 of its crest pi R / (2 w)."""
    gain = rate_limited_sine(np.array([1.0, 1.8621, 5.0, 100.0]))
    assert gain[0] == 1
    np.testing.assert_allclose(
        np.abs(gain[1:]), 8 / np.pi**2 * np.pi / 2 / np.array([1.8621, 5, 100]), rtol=2e-5
    )


@pytest.mark.parametrize("slope", [0.3, 1.0, 3.0])
def test_the_gain_of_the_rate_is_the_mean_over_rayleigh_amplitudes(slope: float) -> None:
    corners = [0, 0.5 / slope**2, 0.5 * FULL**2 / slope**2, 40.0]
    mean = 0j
    for low, high in itertools.pairwise(corners):
        x = low + (high - low) * (np.arange(4000) + 0.5) / 4000
        n = rate_limited_sine(slope * np.sqrt(2 * x))
        mean += (high - low) * (x * np.exp(-x) * n).mean()
    assert rate_gain(2.0, slope / 3.0, 6.0) == pytest.approx(mean, abs=3e-4)


def test_the_gain_of_the_rate_is_that_of_a_narrow_band(at, through) -> None:
    """Random-phase lines within 10 % of 10 Hz: the scatter of the mean over 81 lines, estimated from them."""
    n, step, rng = 32_000, 2.5e-4, np.random.default_rng(16)
    lines = np.arange(76, 85)  # bins of 0.125 Hz about 10 Hz
    means = []
    for _ in range(9):
        spectrum = np.zeros(n // 2 + 1, dtype=complex)
        spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
        torque = np.fft.irfft(spectrum, n)[::4]
        torque /= torque.std()
        out = through(
            Saturation, np.tile(torque, 2), at("torque", step=4 * step), limit=99.0, rate=20 * np.pi
        )
        u, y = np.fft.rfft(torque)[lines], np.fft.rfft(out[len(torque) :])[lines]
        means.append((y @ u.conj()) / (u @ u.conj()))
    scatter = np.std(means, ddof=1) / np.sqrt(len(means))
    held = 0.5 * 2 * np.pi * 10 * 4 * step  # what holding the command for a step may add
    assert abs(np.mean(means) - rate_gain(20 * np.pi, 1.0, 20 * np.pi)) < 5 * scatter + held
    assert scatter < 0.03


def test_without_a_known_torque_the_gain_is_one_below_the_limit(at) -> None:
    gain = Saturation.gain(np.array([20.0, 1e5]), at("torque"), np.array([1.0, 500.0]), Motion(load=5.0))
    np.testing.assert_allclose(gain, 1, rtol=1e-12)
