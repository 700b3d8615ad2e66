"""Viscous friction: one number in all three uses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import ForceEffect, Motion, Place
from robid_effects.viscous import Viscous

NONE, PARAMETERS = np.zeros(0), np.array([0.03])


def test_the_torque_is_proportional_to_speed_and_nothing_else() -> None:
    for speed in (-40.0, 0.0, 0.2, 9.0):
        force, in_position, in_velocity = Viscous.law(3.0, speed, -5.0, NONE, NONE, PARAMETERS, 1e-3)
        assert (force, in_position, in_velocity) == pytest.approx((0.03 * speed, 0.0, 0.03), rel=1e-15)


def test_the_gain_is_the_coefficient_under_any_motion(at: Callable[..., Place]) -> None:
    motion = Motion(velocity_rms=np.array([[0.0], [1.0]]), sine_speed=np.array([0.0, 3.0, 40.0]))
    equivalent = Viscous.linearize(PARAMETERS, at("gear"), motion)
    numeric = ForceEffect.linearize.__func__(Viscous, PARAMETERS, at("gear"), motion)
    assert equivalent.damping.shape == (2, 3)
    np.testing.assert_allclose(equivalent.damping, 0.03)
    np.testing.assert_allclose(numeric.damping, 0.03, rtol=1e-10)
    assert not np.any(equivalent.stiffness)


def test_the_regressor_is_the_speed(at: Callable[..., Place]) -> None:
    speed = np.linspace(-2, 2, 5)
    assert np.array_equal(Viscous.regressor(NONE, speed, NONE, PARAMETERS, at("motor"))["viscous"], speed)
