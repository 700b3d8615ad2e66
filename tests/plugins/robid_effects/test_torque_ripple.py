"""Torque ripple and cogging: the law against integrals and the discrete Fourier transform."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0

from robid_core import Motion
from robid_effects.torque_ripple import Cogging, TorqueRipple

PARAMETERS = np.array([0.3, 0.05, 6.0, 0.4])  # amplitude, relative, order, phase


@pytest.mark.parametrize("speed", [0.0, 3.0, 400.0, 1000.0, -2500.0])
def test_it_is_the_mean_of_the_wave_over_the_step(at, speed: float) -> None:
    (term,) = TorqueRipple.bind(PARAMETERS, at("torque"))
    step, middle = 2.5e-4, 1.7
    mean, _ = quad(
        lambda t: 2 + (0.3 + 0.05 * 2) * np.sin(6 * (middle + speed * t) + 0.4), -step / 2, step / 2
    )
    law = term.law(2.0, middle, speed, np.zeros(0), np.zeros(0), term.arguments, step)
    # sin(x)/x is right to 3e-7 of the wave's size 0.4; at 2500 rad/s x = 1.9
    assert law == pytest.approx(mean / step, abs=0.4 * 3e-7)


def test_a_wave_that_passes_within_a_step_averages_away(at, through) -> None:
    speed = 2 * np.pi / 6 / 2.5e-4  # a period of the wave a step
    out = through(
        TorqueRipple, np.full(9, 2.0), at("torque"), np.linspace(0, 1, 9), 1.5 * speed, amplitude=0.3
    )
    np.testing.assert_allclose(out, 2.0, atol=0.3 * 3e-7)


def test_a_constant_turn_shows_one_line_at_the_order(at, through) -> None:
    n = 96
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    speed = 2 * np.pi / n / 2.5e-4
    values = dict(zip(("amplitude", "relative", "order", "phase"), PARAMETERS, strict=True))
    out = through(TorqueRipple, np.full(n, 2.0), at("torque"), angle, speed, **values)
    lines = np.fft.rfft(out) / n
    x = np.pi * 6 / n  # half the phase of the wave in a step
    start = 2 * np.pi * 6 * 0.5 / n  # of the wave at the first sample
    expected = np.zeros(n // 2 + 1, dtype=complex)
    expected[0] = 2.0
    expected[6] = 0.4 / 2j * np.exp(1j * (0.4 + start)) * np.sin(x) / x
    np.testing.assert_allclose(lines, expected, atol=1e-14)


def test_a_whole_order_repeats_every_turn_and_a_broken_one_does_not(at, through) -> None:
    angle = np.array([0.3, 0.3 + 2 * np.pi, 0.3 - 14 * np.pi])
    whole = through(Cogging, np.zeros(3), at("torque"), angle, order=12.0)
    broken = through(Cogging, np.zeros(3), at("torque"), angle, order=12.3)
    assert np.ptp(whole) < 1e-13
    assert np.ptp(broken) > 0.05


def test_the_gain_is_the_line_of_a_torque_while_the_motor_swings(at, through) -> None:
    """Torque on bin 40, slow sine of 0.9 rad on bin 1: orders of the swing near bin 80 are below 1e-16."""
    n = 512
    t = 2 * np.pi * np.arange(n) / n
    torque = np.cos(40 * t)
    angle = 0.7 + 0.9 * np.sin(t)
    values = {"amplitude": 0.0, "relative": 0.2, "order": 6.0, "phase": 0.4}
    out = through(TorqueRipple, torque, at("torque"), angle, **values)
    line = np.fft.rfft(out)[40] / np.fft.rfft(torque)[40]
    motion = Motion(sine_speed=0.9 * 3.0, sine_omega=3.0, position_bias=0.7)
    gain = TorqueRipple.gain(np.array(list(values.values())), at("torque"), np.array([1.0, 9.0]), motion)
    assert gain.shape == (2,)
    np.testing.assert_allclose(gain, line, atol=1e-13)
    assert gain[0].real == pytest.approx(1 + 0.2 * np.sin(6 * 0.7 + 0.4) * j0(5.4), abs=1e-14)


def test_the_gain_under_a_gaussian_swing_is_that_of_many_draws(at) -> None:
    """400 000 draws of angle and torque: the mean of u^2 sin has standard deviation below sqrt(3)."""
    rng = np.random.default_rng(2)
    n = 400_000
    torque, angle = rng.standard_normal(n), 0.2 + 0.15 * rng.standard_normal(n)
    out = torque + 0.3 * torque * np.sin(6 * angle + 0.4)
    motion = Motion(position_bias=np.array([0.2, 0.5]), position_rms=0.15)
    gain = TorqueRipple.gain(np.array([0.1, 0.3, 6.0, 0.4]), at("torque"), np.array([1.0]), motion)
    assert gain.shape == (2, 1)
    assert gain[0, 0].real == pytest.approx(out @ torque / (torque @ torque), abs=5 * 0.3 * np.sqrt(3 / n))
    assert abs(gain[0, 0] - gain[1, 0]) > 0.05


def test_a_slow_sine_of_unknown_frequency_passes_many_periods(at) -> None:
    gain = TorqueRipple.gain(PARAMETERS, at("torque"), np.array([1.0]), Motion(sine_speed=5.0))
    assert gain[0] == 1


def test_regressor_times_size_is_what_the_law_adds(at, through) -> None:
    rng = np.random.default_rng(1)
    torque, angle = rng.standard_normal(50), 30 * rng.standard_normal(50)
    place = at("torque")
    values = dict(zip(("amplitude", "relative", "order", "phase"), PARAMETERS, strict=True))
    columns = TorqueRipple.regressor(torque, angle, np.zeros(50), PARAMETERS, place)
    added = through(TorqueRipple, torque, place, angle, **values) - torque
    np.testing.assert_allclose(
        sum(values[name] * column for name, column in columns.items()), added, atol=1e-14
    )
    cogging = np.array([0.3, 6.0, 0.4])
    columns = Cogging.regressor(torque, angle, np.zeros(50), cogging, place)
    added = through(Cogging, torque, place, angle, amplitude=0.3, order=6.0, phase=0.4) - torque
    np.testing.assert_allclose(0.3 * columns["amplitude"], added, atol=1e-14)
    assert (Cogging.gain(cogging, place, np.arange(3.0), Motion(position_rms=1.0)) == 1).all()
