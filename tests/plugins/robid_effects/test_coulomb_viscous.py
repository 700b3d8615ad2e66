"""One law, three uses: the effect's law, its slope, its linearisation and its regressor agree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import ForceEffect, Motion, Place
from robid_core.mechanics import friction_torque
from robid_effects.coulomb_viscous import CoulombViscous

PARAMETERS = np.array([0.8, 0.004, 0.5, 0.1])
NONE = np.zeros(0)


def law(speed: float) -> tuple[float, float, float]:
    return CoulombViscous.law(0.0, speed, 0.0, NONE, NONE, PARAMETERS, 1e-3)


def test_the_law_is_the_friction_of_the_core_and_an_offset() -> None:
    for speed in np.linspace(-30, 30, 41):
        force, in_position, _ = law(speed)
        expected = float(friction_torque(speed, *PARAMETERS[:3])) + PARAMETERS[3]
        assert force == pytest.approx(expected, rel=1e-12, abs=1e-14)
        assert in_position == 0.0


def test_the_slope_is_the_central_difference_of_the_force() -> None:
    h = 1e-5
    for speed in (-3.0, -0.2, 0.0, 0.1, 0.7, 12.0):
        # Third derivative below 2 F_c / v_s^3 = 13: error h^2 / 6 * 13, and rounding eps / h.
        assert law(speed)[2] == pytest.approx((law(speed + h)[0] - law(speed - h)[0]) / (2 * h), abs=1e-9)


def test_the_linearisation_is_the_mean_slope_over_the_motion(at: Callable[..., Place]) -> None:
    """Monte Carlo over Gaussian plus sine, 400 000 draws: within 5 standard errors of the mean."""
    rng = np.random.default_rng(1)
    speed = 4.0 * rng.standard_normal(400_000) + 9.0 * np.sin(2 * np.pi * rng.random(400_000))
    level = np.tanh(speed / PARAMETERS[2])
    slopes = PARAMETERS[0] * (1 - level**2) / PARAMETERS[2] + PARAMETERS[1]
    equivalent = CoulombViscous.linearize(PARAMETERS, at("motor"), Motion(velocity_rms=4.0, sine_speed=9.0))
    error = slopes.std() / np.sqrt(len(slopes))
    assert float(equivalent.damping) == pytest.approx(slopes.mean(), abs=5 * error)
    assert equivalent.stiffness == 0.0


def test_the_closed_form_is_what_integration_of_the_law_gives(at: Callable[..., Place]) -> None:
    motion = Motion(velocity_rms=np.array([0.3, 2.0, 2.0]), sine_speed=np.array([0.0, 0.0, 7.0]))
    closed = CoulombViscous.linearize(PARAMETERS, at("motor"), motion)
    numeric = ForceEffect.linearize.__func__(CoulombViscous, PARAMETERS, at("motor"), motion)
    np.testing.assert_allclose(closed.damping, numeric.damping, rtol=1e-6)  # stated: 1e-4
    np.testing.assert_array_equal(closed.stiffness, numeric.stiffness)


def test_the_regressor_times_the_parameters_is_the_force(at: Callable[..., Place]) -> None:
    speed = np.linspace(-5, 5, 11)
    columns = CoulombViscous.regressor(NONE, speed, NONE, PARAMETERS, at("motor"))
    force = sum(
        columns[row.name] * PARAMETERS[k]
        for k, row in enumerate(CoulombViscous.parameters)
        if row.name in columns
    )
    np.testing.assert_allclose(force, [law(v)[0] for v in speed], rtol=1e-12)


def test_its_bounds_hold_its_defaults() -> None:
    for parameter, value in zip(CoulombViscous.parameters, CoulombViscous.defaults(), strict=True):
        assert parameter.lower <= value <= parameter.upper
