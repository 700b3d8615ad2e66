"""Stribeck friction: the curve, its slope, and how its gain fades with the motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import ConfigurationError, Motion, Place
from robid_effects.stribeck import Stribeck, stribeck_decay, stribeck_level

NONE = np.zeros(0)


def parameters(**changes: float) -> np.ndarray:
    return np.array([changes.get(row.name, row.default) for row in Stribeck.parameters])


def force(speed: float, values: np.ndarray) -> tuple[float, float, float]:
    return Stribeck.law(0.0, speed, 0.0, NONE, NONE, values, 1e-3)


def test_the_level_of_the_bristles_is_the_curve_with_exponent_2() -> None:
    for speed in (-9.0, -0.4, 0.3, 2.0, 5.0):
        decay, slope = stribeck_decay(speed, 4.0, 2.0)
        level, level_slope = stribeck_level(speed, 0.5, 1.1, 4.0)
        assert level == pytest.approx(0.5 + 0.6 * decay, rel=1e-13)
        assert level_slope == pytest.approx(0.6 * slope, rel=1e-12)
    assert stribeck_level(0.0, 0.5, 1.1, 4.0) == (1.1, 0.0)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.3, 2.0, 4.0])
def test_the_curve_is_that_of_the_formula(exponent: float) -> None:
    values = parameters(
        exponent=exponent, coulomb=0.5, breakaway=1.1, stribeck_speed=4.0, viscous=0.02, speed=0.1
    )
    for speed in (-60.0, -4.0, -0.3, 0.0, 1e-6, 0.05, 2.0, 9.0):
        level = 0.5 + 0.6 * np.exp(-(abs(speed / 4.0) ** exponent))
        assert force(speed, values)[0] == pytest.approx(
            level * np.tanh(speed / 0.1) + 0.02 * speed, rel=1e-12, abs=1e-15
        )


@pytest.mark.parametrize("exponent", [1.0, 1.3, 2.0])
def test_slopes_are_differences_and_fall_below_zero_after_the_peak(exponent: float) -> None:
    values, h = parameters(exponent=exponent), 1e-6
    for speed in (-5.0, -0.1, 0.03, 1.0, 20.0):
        up, down = force(speed + h, values)[0], force(speed - h, values)[0]
        # the largest third derivative is the smoothing's, 2 F_s / v_0^3 = 200: h^2 / 6 * 200, and rounding eps / h
        assert force(speed, values)[2] == pytest.approx((up - down) / (2 * h), abs=2e-9)
    assert force(3.0, values)[2] < 0.0


def test_the_decay_has_a_finite_slope_at_rest() -> None:
    for exponent in (1.0, 1.3, 2.0):
        assert stribeck_decay(0.0, 5.0, exponent) == (pytest.approx(1.0, abs=1e-15), 0.0)


@pytest.mark.parametrize("rms", [0.5, 3.0, 20.0])
def test_the_gain_of_the_excess_fades_as_the_closed_form_says(rms: float, at: Callable[..., Place]) -> None:
    """Gaussian speeds, n = 2, sharp sign: sqrt(2/pi) / rms (F_c + (F_s - F_c) / (1 + 2 rms^2 / v_S^2))."""
    values = parameters(coulomb=0.5, breakaway=1.1, stribeck_speed=4.0, speed=1e-5, viscous=0.01)
    gain = Stribeck.linearize(values, at("motor"), Motion(velocity_rms=rms)).damping
    expected = np.sqrt(2 / np.pi) / rms * (0.5 + 0.6 / (1 + 2 * rms**2 / 16.0)) + 0.01
    assert float(gain) == pytest.approx(expected, rel=1e-4)


def test_the_gain_is_the_regression_of_the_torque_on_the_gaussian_part(at: Callable[..., Place]) -> None:
    """400 000 draws of Gaussian plus sine: within 5 standard errors."""
    values, rng, n = parameters(exponent=1.3), np.random.default_rng(4), 400_000
    fast, slow = 3.0 * rng.standard_normal(n), 8.0 * np.sin(2 * np.pi * rng.random(n))
    columns = Stribeck.regressor(NONE, fast + slow, NONE, values, at("motor"))
    torque = columns["coulomb"] * values[0] + columns["breakaway"] * values[1]
    product = torque * fast / 9.0
    gain = Stribeck.linearize(values, at("motor"), Motion(velocity_rms=3.0, sine_speed=8.0)).damping
    assert float(gain) == pytest.approx(product.mean(), abs=5 * product.std() / np.sqrt(n))


def test_the_regressor_times_the_parameters_is_the_force(at: Callable[..., Place]) -> None:
    values, speed = parameters(viscous=0.03, exponent=1.3), np.linspace(-9, 9, 37)
    columns = Stribeck.regressor(NONE, speed, NONE, values, at("motor"))
    total = columns["coulomb"] * values[0] + columns["breakaway"] * values[1] + columns["viscous"] * values[4]
    np.testing.assert_allclose(total, [force(v, values)[0] for v in speed], rtol=1e-12, atol=1e-14)


def test_a_level_of_slow_sliding_below_that_of_fast_sliding_is_refused(at: Callable[..., Place]) -> None:
    with pytest.raises(ConfigurationError, match=r"tried: breakaway is 0\.4 N m, below coulomb 0\.5"):
        Stribeck.arguments(parameters(breakaway=0.4), at("motor"))
