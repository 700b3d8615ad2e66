"""Friction and temperature: the balance of heat against an integrator, and the gain at the start temperature."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robid_core import ForceEffect, Motion, Place
from robid_effects.temperature import Temperature


def parameters(**changes: float) -> np.ndarray:
    assert set(changes) <= {row.name for row in Temperature.parameters}
    return np.array([changes.get(row.name, row.default) for row in Temperature.parameters])


def law(
    speed: float, rise: float, values: np.ndarray, step: float
) -> tuple[tuple[float, float, float], float]:
    state, following = np.array([rise]), np.zeros(1)
    return Temperature.law(0.0, speed, 0.0, state, following, values, step), float(following[0])


def torque(speed: float, temperature: float, values: np.ndarray) -> float:
    coulomb, slope, hot, cold, decay, _, ambient, _, _, smooth = values
    level = max(coulomb + slope * (temperature - ambient), 0.0)
    viscous = hot + cold * np.exp(-(temperature - ambient) / decay)
    return float(level * np.tanh(speed / smooth) + viscous * speed)


@pytest.mark.parametrize("rise", [-30.0, 0.0, 15.0, 300.0])
def test_viscous_friction_falls_exponentially_and_coulomb_linearly_but_not_below_zero(rise: float) -> None:
    values = parameters(start=40.0, coulomb_slope=-0.003)
    for speed in (-90.0, -0.2, 0.0, 3.0):
        (force, in_position, _), following = law(speed, rise, values, 0.0)
        assert force == pytest.approx(torque(speed, 40.0 + rise, values), rel=1e-13, abs=1e-15)
        assert (in_position, following) == (0.0, rise)


def test_a_drive_at_constant_speed_warms_up_as_the_heat_balance_says() -> None:
    """Ten minutes from cold at 60 rad/s, steps of 1 s: implicit Euler's error is step / (2 tau) of the way or less."""
    values = parameters(start=10.0, capacity=800.0, time_constant=300.0, viscous_cold=0.02)
    rise = 0.0
    for _ in range(600):
        rise = law(60.0, rise, values, 1.0)[1]

    def warm(_: float, t: np.ndarray) -> np.ndarray:
        return torque(60.0, 10.0 + t[0], values) * 60.0 / 800.0 - (t - 15.0) / 300.0

    expected = solve_ivp(warm, (0, 600), [0.0], rtol=1e-10, atol=1e-10).y[0, -1]
    assert expected > 20.0
    assert rise == pytest.approx(expected, rel=5e-3)
    finer = 0.0
    for _ in range(2400):
        finer = law(60.0, finer, values, 0.25)[1]
    assert abs(finer - expected) == pytest.approx(abs(rise - expected) / 4, rel=0.05)  # first order


def test_a_warm_drive_at_rest_cools_to_the_ambient_for_any_step() -> None:
    values = parameters(start=80.0, time_constant=100.0)
    for step in (1e-3, 10.0, 1e6):
        rise = 0.0
        for _ in range(50):
            following = law(0.0, rise, values, step)[1]
            assert -55.0 <= following <= rise
            rise = following
    assert rise == pytest.approx(-55.0, abs=1e-6)


def test_the_slope_holds_what_the_speed_does_to_the_temperature_within_half_a_step() -> None:
    """A gear of hardly any heat capacity and a step of a second, so that this is a tenth of the slope."""
    values, h = parameters(capacity=20.0, viscous_cold=0.02, start=30.0), 1e-4
    for speed in (-30.0, -2.0, 25.0):
        (up, _, _), _ = law(speed + h, 1.0, values, 1.0)
        (down, _, _), _ = law(speed - h, 1.0, values, 1.0)
        (_, _, slope), _ = law(speed, 1.0, values, 1.0)
        fixed = law(speed, 1.0, values, 0.0)[0][2]
        difference = (up - down) / (2 * h)
        # what is left out is how the speed changes the fall, second order in the step: a tenth of the difference here
        assert abs(slope - difference) < 0.15 * abs(fixed - difference)


def test_the_gain_is_that_of_the_start_temperature(at: Callable[..., Place]) -> None:
    """Against the law run along a motion, with so large a heat capacity that nothing warms: its scatter, 1 %."""
    values = parameters(start=45.0, capacity=1e8, time_constant=1e6)
    motion = Motion(velocity_rms=3.0, sine_speed=6.0, omega=60.0)
    closed = Temperature.linearize(values, at("motor"), motion)
    numeric = ForceEffect.linearize.__func__(Temperature, values, at("motor"), motion)
    assert float(closed.damping) == pytest.approx(float(numeric.damping), rel=0.01)
    assert float(Temperature.linearize(parameters(start=5.0), at("motor"), motion).damping) > float(
        closed.damping
    )
