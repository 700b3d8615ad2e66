"""Resolver ripple: against an imperfect resolver, order analysis and the linearised gain."""

import numpy as np
import pytest

from robid_core import Motion
from robid_effects.resolver_ripple import ResolverRipple

TURN = np.linspace(0, 2 * np.pi, 240, endpoint=False)


def test_windings_of_unlike_size_ripple_twice_a_turn(at, through) -> None:
    """arctan2((1 + a) sin, cos) - angle = m sin 2 angle + m^2 / 2 sin 4 angle..., m = a / (2 + a)."""
    a = 0.004
    angle = 0.5 * (TURN - np.pi)  # within half a turn, where arctan2 does not jump
    resolver = np.arctan2((1 + a) * np.sin(angle), np.cos(angle))
    m = a / (2 + a)
    out = through(ResolverRipple, angle, at("position"), angle, amplitude=m, order=2.0, phase=0.0)
    np.testing.assert_allclose(out, resolver, atol=0.51 * m * m)


def test_windings_off_the_right_angle_ripple_in_quadrature(at, through) -> None:
    """Second winding cos(angle - b): arctan2(sin, that) - angle = -b/2 (1 - cos 2 angle) to second order in b."""
    b = 0.002
    angle = 0.5 * (TURN - np.pi)
    resolver = np.arctan2(np.sin(angle), np.cos(angle - b))
    out = through(ResolverRipple, angle, at("position"), angle, amplitude=b / 2, order=2.0, phase=np.pi / 2)
    np.testing.assert_allclose(out - b / 2, resolver, atol=b * b)


def test_a_turn_shows_one_line_at_the_order_and_closes(at, through) -> None:
    out = through(ResolverRipple, TURN, at("position"), TURN, amplitude=1e-3, order=8.0, phase=0.3)
    lines = np.fft.rfft(out - TURN) / len(TURN)
    expected = np.zeros(len(lines), dtype=complex)
    expected[8] = 1e-3 / 2j * np.exp(0.3j)
    np.testing.assert_allclose(lines, expected, atol=1e-15)
    again = through(
        ResolverRipple, TURN + 20 * np.pi, at("position"), TURN + 20 * np.pi, amplitude=1e-3, order=8.0
    )
    first = through(ResolverRipple, TURN, at("position"), TURN, amplitude=1e-3, order=8.0)
    np.testing.assert_allclose(again - 20 * np.pi, first, atol=1e-13)


def test_the_ripple_is_that_of_the_rotor_whatever_came_before(at, through) -> None:
    offset = through(ResolverRipple, TURN + 0.1, at("position"), TURN)
    np.testing.assert_allclose(offset - 0.1, through(ResolverRipple, TURN, at("position"), TURN), atol=1e-14)


def test_the_gain_is_the_line_of_a_small_sine_while_the_motor_swings(at, through) -> None:
    """Small sine e = 1e-5 rad on bin 40: what is cubic in it is (order e)^2 / 8 = 2e-10 of the ripple's share."""
    n, order, amplitude = 512, 4.0, 0.02
    t = 2 * np.pi * np.arange(n) / n
    small = 1e-5 * np.cos(40 * t)
    angle = 0.7 + 1.1 * np.sin(t) + small
    out = through(ResolverRipple, angle, at("position"), angle, amplitude=amplitude, order=order, phase=0.4)
    line = np.fft.rfft(out)[40] / np.fft.rfft(small)[40]
    motion = Motion(sine_speed=1.1 * 2.0, sine_omega=2.0, position_bias=0.7)
    gain = ResolverRipple.gain(np.array([amplitude, order, 0.4]), at("position"), np.array([5.0]), motion)
    # rounding of angles near 2 rad: 2e-16 / 1e-5, over sqrt(512) samples
    assert gain[0] == pytest.approx(line, abs=1e-10)
    assert abs(gain[0] - 1) > 0.01


def test_the_gain_under_a_gaussian_swing_is_that_of_many_draws(at) -> None:
    """E[slope] by the covariance of output and input (Stein); standard error from the sample."""
    rng = np.random.default_rng(3)
    swing = 0.3 * rng.standard_normal(400_000)
    added = 0.02 * np.sin(4 * (0.7 + swing) + 0.4)
    products = added * swing / 0.3**2
    gain = ResolverRipple.gain(
        np.array([0.02, 4.0, 0.4]),
        at("position"),
        np.array([5.0]),
        Motion(position_bias=0.7, position_rms=0.3),
    )
    error = products.std() / np.sqrt(len(products))
    assert gain[0].real - 1 == pytest.approx(products.mean(), abs=5 * error)
    assert abs(gain[0] - 1) > 10 * error


def test_regressor_times_amplitude_is_what_the_law_adds(at, through) -> None:
    parameters = np.array([2e-3, 8.0, 0.3])
    column = ResolverRipple.regressor(TURN, TURN, np.zeros(240), parameters, at("position"))["amplitude"]
    out = through(ResolverRipple, TURN, at("position"), TURN, amplitude=2e-3, order=8.0, phase=0.3)
    np.testing.assert_allclose(2e-3 * column, out - TURN, atol=1e-14)
