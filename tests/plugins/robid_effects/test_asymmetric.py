"""Friction that differs with the direction: each side its own, no torque at rest, the mean for a small signal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import ForceEffect, Motion, Place
from robid_core.mechanics import friction_torque
from robid_effects.asymmetric import Asymmetric

NONE = np.zeros(0)
PARAMETERS = np.array([0.9, 0.02, 0.6, 0.01, 0.3])


def law(speed: float) -> tuple[float, float, float]:
    return Asymmetric.law(0.0, speed, 0.0, NONE, NONE, PARAMETERS, 1e-3)


def test_each_direction_has_its_own_coulomb_and_viscous_friction() -> None:
    for speed in (1e-3, 0.2, 5.0, 80.0):
        assert law(speed)[0] == pytest.approx(float(friction_torque(speed, 0.9, 0.02, 0.3)), rel=1e-13)
        assert law(-speed)[0] == pytest.approx(-float(friction_torque(speed, 0.6, 0.01, 0.3)), rel=1e-13)
    assert law(0.0)[0] == 0.0


def test_slopes_are_differences_on_both_sides() -> None:
    h = 1e-6
    for speed in (-7.0, -0.2, -1e-3, 1e-3, 0.4, 11.0):
        # third derivative below 2 F_c / v_s^3 = 67: h^2 / 6 * 67, and rounding eps / h
        assert law(speed)[2] == pytest.approx((law(speed + h)[0] - law(speed - h)[0]) / (2 * h), abs=1e-8)


def test_the_mean_of_both_sides_is_what_integration_of_the_law_gives(at: Callable[..., Place]) -> None:
    motion = Motion(velocity_rms=np.array([0.2, 3.0, 3.0]), sine_speed=np.array([0.0, 0.0, 8.0]))
    closed = Asymmetric.linearize(PARAMETERS, at("motor"), motion)
    numeric = ForceEffect.linearize.__func__(Asymmetric, PARAMETERS, at("motor"), motion)
    np.testing.assert_allclose(closed.damping, numeric.damping, rtol=1e-6)


def test_half_the_difference_is_a_torque_that_stays(at: Callable[..., Place]) -> None:
    """Mean over a slow sine, fast beside the smoothing speed: (F_c+ - F_c-) / 2 and A (d+ - d-) / pi.

    The smooth sign misses its level by the time below the smoothing speed, ln 2 v_s / (A pi / 2) on each side.
    """
    speed = 100.0 * np.sin(2 * np.pi * (np.arange(20000) + 0.5) / 20000)
    columns = Asymmetric.regressor(NONE, speed, NONE, PARAMETERS, at("motor"))
    force = sum(columns[row.name] * PARAMETERS[k] for k, row in enumerate(Asymmetric.parameters[:4]))
    miss = 2 * np.log(2) * 0.3 / (np.pi * 100.0)
    assert force.mean() == pytest.approx(0.15 * (1 - miss) + 100.0 * 0.01 / np.pi, rel=1e-5)


def test_the_regressor_times_the_parameters_is_the_force(at: Callable[..., Place]) -> None:
    speed = np.linspace(-3, 3, 31)
    columns = Asymmetric.regressor(NONE, speed, NONE, PARAMETERS, at("motor"))
    force = sum(columns[row.name] * PARAMETERS[k] for k, row in enumerate(Asymmetric.parameters[:4]))
    np.testing.assert_allclose(force, [law(v)[0] for v in speed], rtol=1e-12, atol=1e-14)
