"""Friction curved in speed: powers, an Eyring fluid; each direction its own, passive, smooth at rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import ForceEffect, Place
from robid_effects.asymmetric import Asymmetric
from robid_effects.eyring import Eyring
from robid_effects.power_law import PowerLaw

NONE = np.zeros(0)
POWER = np.array([0.9, 0.02, 0.3, 0.6, 0.01, 0.4, 1 / 3, 0.2])
FLUID = np.array([0.9, 0.02, 0.3, 0.6, 0.01, 0.4, 2.0, 0.2])
BOTH = pytest.mark.parametrize(("effect", "parameters"), [(PowerLaw, POWER), (Eyring, FLUID)])
SPEEDS = (-70.0, -3.0, -0.2, -1e-3, 0.0, 1e-3, 0.4, 11.0, 200.0)


def law(effect: type[ForceEffect], speed: float, parameters: np.ndarray) -> tuple[float, float, float]:
    return effect.law(0.0, speed, 0.0, NONE, NONE, parameters, 1e-3)


@BOTH
def test_slopes_are_differences_on_both_sides(effect: type[ForceEffect], parameters: np.ndarray) -> None:
    """With h = 1e-6: third derivatives are below 2 F / v_s^3 = 300, of which h^2 / 6 counts, and rounding eps / h."""
    h = 1e-6
    for speed in (-70.0, -3.0, -0.2, -1e-3, 1e-3, 0.4, 11.0):
        ends = [law(effect, speed + sign * h, parameters)[0] for sign in (1, -1)]
        assert law(effect, speed, parameters)[2] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-8)


@BOTH
def test_it_takes_energy_whichever_way_and_grows_with_speed(
    effect: type[ForceEffect], parameters: np.ndarray
) -> None:
    forces = [law(effect, speed, parameters)[0] for speed in SPEEDS]
    assert all(force * speed >= 0 for force, speed in zip(forces, SPEEDS, strict=True))
    assert (np.diff(forces) > 0).all()


@BOTH
def test_the_regressor_times_the_parameters_is_the_force(
    effect: type[ForceEffect], parameters: np.ndarray, at: Callable[..., Place]
) -> None:
    speed = np.array(SPEEDS)
    columns = effect.regressor(NONE, speed, NONE, parameters, at("motor"))
    force = sum(columns[row.name] * parameters[k] for k, row in enumerate(effect.parameters[:6]))
    np.testing.assert_allclose(force, [law(effect, v, parameters)[0] for v in speed], rtol=1e-7, atol=1e-14)


@BOTH
def test_without_curvature_it_is_asymmetric_friction(
    effect: type[ForceEffect], parameters: np.ndarray
) -> None:
    straight = parameters.copy()
    straight[[2, 5]] = 0.0
    for speed in SPEEDS:
        expected = Asymmetric.law(0.0, speed, 0.0, NONE, NONE, straight[[0, 1, 3, 4, 7]], 1e-3)
        assert law(effect, speed, straight) == pytest.approx(expected, rel=1e-13)


def test_eight_smoothing_speeds_away_a_power_is_one_within_a_percent() -> None:
    power = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1 / 3, 0.2])
    for speed in (1.6, 5.0, 90.0):
        assert law(PowerLaw, speed, power)[0] == pytest.approx(speed ** (1 / 3), rel=0.01)


def test_an_eyring_fluid_is_viscous_when_slow_and_a_logarithm_when_fast() -> None:
    fluid = np.array([0.0, 0.0, 3.0, 0.0, 0.0, 3.0, 2.0, 0.2])
    assert law(Eyring, 0.02, fluid)[0] == pytest.approx(3.0 * 0.01, rel=1e-4)  # x - x^3 / 6
    decade = law(Eyring, 2000.0, fluid)[0] - law(Eyring, 200.0, fluid)[0]
    assert decade == pytest.approx(3.0 * np.log(10.0), rel=1e-4)
