"""The soft wind-up zone: stiffness inside and outside, its friction."""

import numpy as np
import pytest

from robid_effects.good import SoftZone

SOFTNESS, ZONE, HYSTERESIS, SPEED = 0.4, 5e-4, 2.0, 5e-3
PARAMETERS = np.array([SOFTNESS, ZONE, HYSTERESIS, SPEED])
SPRING = 9e4


@pytest.fixture
def place(at):
    return at("gear", stiffness=SPRING)


def law(position: float, velocity: float, place) -> tuple[float, float, float]:
    arguments = SoftZone.arguments(PARAMETERS, place)
    return SoftZone.law(position, velocity, 0.0, np.zeros(1), np.zeros(1), arguments, 2.5e-4)


def torque(position: float, place) -> float:
    return law(position, 0.0, place)[0] + SPRING * position


def test_the_gear_is_soft_inside_and_as_the_file_has_it_outside(place) -> None:
    for x in (0.0, 1e-5, -0.2 * ZONE):
        assert torque(x, place) == pytest.approx(SOFTNESS * SPRING * x, abs=1e-12)
        assert law(x, 0.0, place)[1] + SPRING == pytest.approx(SOFTNESS * SPRING, rel=1e-12)
    lost = (1 - SOFTNESS) * 0.5 * ZONE
    for x in (0.8 * ZONE, 3e-3):
        assert torque(x, place) == pytest.approx(SPRING * (x - lost), rel=1e-12)
        assert torque(-x, place) == -torque(x, place)
        assert law(x, 0.0, place)[1] == pytest.approx(0.0, abs=1e-9)


def test_the_friction_works_against_the_deflection_and_only_takes_energy(place) -> None:
    for speed in (-1.0, -2e-3, 1e-4, 0.3):
        friction = law(0.0, speed, place)[0]
        assert friction == pytest.approx(HYSTERESIS * np.tanh(speed / SPEED), rel=1e-12)
        assert friction * speed > 0


def test_slopes_are_derivatives(place) -> None:
    rng, h, g = np.random.default_rng(2), 1e-9, 1e-7
    for x, v in zip(rng.uniform(-ZONE, ZONE, 40), rng.normal(0, SPEED, 40), strict=True):
        _, in_position, in_velocity = law(x, v, place)
        by_position = (law(x + h, v, place)[0] - law(x - h, v, place)[0]) / (2 * h)
        by_velocity = (law(x, v + g, place)[0] - law(x, v - g, place)[0]) / (2 * g)
        # Rounding eps * 45 N m / h; at the end of a parabola curvature * h / 2 = 0.1.
        assert in_position == pytest.approx(by_position, abs=0.2)
        assert in_velocity == pytest.approx(by_velocity, abs=1e-5)  # third derivative 2 h / v_s^3, g^2 / 6


def test_the_regressor_is_the_force_per_hysteresis(place) -> None:
    speed = np.array([-0.01, 1e-3, 0.2])
    column = SoftZone.regressor(0 * speed, speed, 0 * speed, PARAMETERS, place)["hysteresis"]
    np.testing.assert_allclose(HYSTERESIS * column, [law(0.0, v, place)[0] for v in speed], rtol=1e-12)
