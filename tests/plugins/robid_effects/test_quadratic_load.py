"""Friction with the load and its square: the formula, its slopes, and what it is without the square."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Place
from robid_effects.load_dependent import LoadDependent
from robid_effects.quadratic_load import QuadraticLoad

NONE = np.zeros(0)


def parameters(**changes: float) -> np.ndarray:
    return np.array([changes.get(row.name, row.default) for row in QuadraticLoad.parameters])


def law(speed: float, load: float, values: np.ndarray) -> tuple[float, float, float]:
    return QuadraticLoad.law(0.0, speed, load, NONE, NONE, values, 1e-3)


def test_the_torque_is_that_of_the_formula_and_slopes_are_differences() -> None:
    values, h = parameters(load_square=0.05, excess=0.4, stribeck_speed=6.0, viscous=0.01, speed=0.3), 1e-6
    for speed in (-40.0, -2.0, 0.0, 0.1, 6.0):
        for load in (-7.0, 0.0, 3.0):
            level = (0.5 + 0.03 * abs(load) + 0.05 * load**2) * (1 + 0.4 * np.exp(-(abs(speed / 6.0) ** 1.3)))
            force, _, slope = law(speed, load, values)
            assert force == pytest.approx(level * np.tanh(speed / 0.3) + 0.01 * speed, rel=1e-12, abs=1e-15)
            if speed:
                change = (law(speed + h, load, values)[0] - law(speed - h, load, values)[0]) / (2 * h)
                # Third derivative below 2 * 4.4 N m / v_s^3 = 330: h^2 / 6 * 330, and rounding of 4 N m over h.
                assert slope == pytest.approx(change, abs=1e-8)


def test_without_square_and_excess_it_is_friction_by_load() -> None:
    values = parameters(load_square=0.0, excess=0.0)
    other = np.array([row.default for row in LoadDependent.parameters])
    other[2] = 0.0
    for speed, load in ((-3.0, 5.0), (0.2, -8.0)):
        ours, theirs = law(speed, load, values), LoadDependent.law(0.0, speed, load, NONE, NONE, other, 1e-3)
        assert ours == pytest.approx(theirs, rel=1e-12)


def test_the_regressor_times_the_parameters_is_the_force(at: Callable[..., Place]) -> None:
    values, speed, load = parameters(viscous=0.02), np.linspace(-9, 9, 37), np.linspace(-6, 8, 37)
    columns = QuadraticLoad.regressor(NONE, speed, load, values, at("motor"))
    total = sum(
        columns[row.name] * values[k] for k, row in enumerate(QuadraticLoad.parameters) if row.name in columns
    )
    expected = [law(v, w, values)[0] for v, w in zip(speed, load, strict=True)]
    np.testing.assert_allclose(total, expected, rtol=1e-12, atol=1e-14)
