"""Coulomb friction: exact level outside the numerical speed, passive, and its gains in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import ForceEffect, Motion, Place
from robid_core.mechanics import equivalent_damping
from robid_effects.coulomb import Coulomb, CoulombTanh

NONE = np.zeros(0)


def law(effect: type[ForceEffect], speed: float, parameters: np.ndarray) -> tuple[float, float, float]:
    return effect.law(0.0, speed, 0.0, NONE, NONE, parameters, 1e-3)


def test_the_sharp_sign_is_sharp_outside_the_numerical_speed() -> None:
    parameters = np.array([0.7, 0.02])
    for speed in (0.0200001, 0.5, 300.0):
        assert law(Coulomb, speed, parameters) == (0.7, 0.0, 0.0)
        assert law(Coulomb, -speed, parameters) == (-0.7, 0.0, 0.0)
    assert law(Coulomb, 0.0, parameters) == (0.0, 0.0, 35.0)


@pytest.mark.parametrize("effect", [Coulomb, CoulombTanh])
def test_slopes_are_differences_and_the_torque_never_drives(effect: type[ForceEffect]) -> None:
    parameters, h = np.array([0.7, 0.4]), 1e-5
    for speed in (-2.0, -0.39, -0.1, 0.0, 0.2, 0.38, 0.41, 9.0):
        force, _, slope = law(effect, speed, parameters)
        up, down = law(effect, speed + h, parameters)[0], law(effect, speed - h, parameters)[0]
        # third derivative of the tanh below 2 F_c / v_s^3 = 22: h^2 / 6 * 22, and rounding eps / h
        assert slope == pytest.approx((up - down) / (2 * h), abs=1e-9)
        assert force * speed >= 0.0
        assert abs(force) <= 0.7


@pytest.mark.parametrize("speed", [0.05, 1.5])
def test_the_gain_of_the_line_between_both_levels_is_the_share_of_time_on_it(
    speed: float, at: Callable[..., Place]
) -> None:
    parameters = np.array([0.7, speed])
    gain = Coulomb.linearize(parameters, at("motor"), Motion(velocity_rms=2.0)).damping
    expected = 0.7 / speed * math.erf(speed / 2.0 / math.sqrt(2))
    assert float(gain) == pytest.approx(
        expected, rel=1e-3
    )  # its kinks lie within panels: see `linearize_law`


@pytest.mark.parametrize("effect", [Coulomb, CoulombTanh])
def test_a_small_numerical_speed_does_not_matter(effect: type[ForceEffect], at: Callable[..., Place]) -> None:
    """Relative error of the order (v_0 / rms)^2 = 2.5e-5."""
    gain = effect.linearize(
        np.array([0.7, 0.01]), at("motor"), Motion(velocity_rms=2.0, sine_speed=5.0)
    ).damping
    assert float(gain) == pytest.approx(float(equivalent_damping(2.0, 5.0, 0.7, 0.0)), rel=1e-4)


def test_the_closed_form_of_the_smooth_sign_is_what_integration_gives(at: Callable[..., Place]) -> None:
    motion = Motion(velocity_rms=np.array([0.3, 2.0]), sine_speed=np.array([0.0, 7.0]))
    parameters = np.array([0.7, 0.3])
    numeric = ForceEffect.linearize.__func__(CoulombTanh, parameters, at("arm"), motion)
    np.testing.assert_allclose(
        CoulombTanh.linearize(parameters, at("arm"), motion).damping, numeric.damping, rtol=1e-6
    )


@pytest.mark.parametrize("effect", [Coulomb, CoulombTanh])
def test_the_regressor_times_the_level_is_the_force(
    effect: type[ForceEffect], at: Callable[..., Place]
) -> None:
    parameters, speed = np.array([0.7, 0.4]), np.linspace(-2, 2, 21)
    column = effect.regressor(NONE, speed, NONE, parameters, at("motor"))["coulomb"]
    np.testing.assert_allclose(
        0.7 * column, [law(effect, v, parameters)[0] for v in speed], rtol=1e-13, atol=1e-15
    )
