"""Coulomb friction that waves with the angle: it turns round with the motion, and adds nothing to the mean level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core import Place
from robid_effects.angle_dependent import AngleDependent

NONE = np.zeros(0)
PARAMETERS = np.array([0.2, 6.0, 0.7, 0.1])


def law(angle: float, speed: float) -> tuple[float, float, float]:
    return AngleDependent.law(angle, speed, 0.0, NONE, NONE, PARAMETERS, 1e-3)


def test_it_turns_round_with_the_motion() -> None:
    for angle in (-2.0, 0.1, 1.3):
        assert law(angle, 5.0)[0] == -law(angle, -5.0)[0]
        assert law(angle, 0.0)[0] == 0.0


def test_slopes_are_differences() -> None:
    """Third derivatives are below 0.2 * max(6^3, 2 / 0.1^3) = 400: h^2 / 6 of it, and rounding eps / h."""
    h = 1e-6
    for angle, speed in ((0.3, 0.02), (-1.0, -0.3), (2.0, 4.0)):
        _, along, by_speed = law(angle, speed)
        there = (law(angle + h, speed)[0] - law(angle - h, speed)[0]) / (2 * h)
        faster = (law(angle, speed + h)[0] - law(angle, speed - h)[0]) / (2 * h)
        np.testing.assert_allclose([along, by_speed], [there, faster], atol=1e-8)


def test_over_a_whole_turn_it_adds_nothing_to_the_mean_level() -> None:
    """Whole orders only: the mean of the wave over a turn is zero, either way."""
    angle = 2 * np.pi * (np.arange(4000) + 0.5) / 4000
    for speed in (3.0, -3.0):
        assert abs(np.mean([law(a, speed)[0] for a in angle])) < 1e-12


def test_the_regressor_times_the_amplitude_is_the_force(at: Callable[..., Place]) -> None:
    angle, speed = np.linspace(-3, 3, 41), np.linspace(2, -2, 41)
    column = AngleDependent.regressor(angle, speed, NONE, PARAMETERS, at("motor"))["amplitude"]
    np.testing.assert_allclose(
        0.2 * column, [law(a, v)[0] for a, v in zip(angle, speed, strict=True)], atol=1e-7
    )
