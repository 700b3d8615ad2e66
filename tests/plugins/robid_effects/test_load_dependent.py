"""Friction that grows with the load: linear in its size, blind to its sign, more at low speed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Motion, Place
from robid_core.mechanics import equivalent_damping
from robid_effects.load_dependent import LoadDependent

NONE = np.zeros(0)


def parameters(**changes: float) -> np.ndarray:
    return np.array([changes.get(row.name, row.default) for row in LoadDependent.parameters])


def law(speed: float, load: float, values: np.ndarray) -> tuple[float, float, float]:
    return LoadDependent.law(0.0, speed, load, NONE, NONE, values, 1e-3)


def test_the_torque_is_that_of_the_formula() -> None:
    values = parameters(
        coulomb=0.4, load_coulomb=0.05, load_excess=0.2, stribeck_speed=6.0, viscous=0.01, speed=0.3
    )
    for speed in (-40.0, -2.0, 0.0, 0.1, 6.0, 90.0):
        for load in (-7.0, 0.0, 3.0):
            level = 0.4 + abs(load) * (0.05 + 0.2 * np.exp(-(abs(speed / 6.0) ** 1.3)))
            expected = level * np.tanh(speed / 0.3) + 0.01 * speed
            assert law(speed, load, values)[0] == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_slopes_are_differences() -> None:
    values, h = parameters(viscous=0.01), 1e-6
    for speed in (-20.0, -0.5, 0.2, 4.0):
        up, down = law(speed + h, -8.0, values)[0], law(speed - h, -8.0, values)[0]
        # third derivative below 2 * 1.5 N m / v_s^3 = 25: h^2 / 6 * 25, and rounding eps / h
        assert law(speed, -8.0, values)[2] == pytest.approx((up - down) / (2 * h), abs=2e-9)


def test_without_the_excess_the_gain_is_that_of_a_higher_coulomb_level(at: Callable[..., Place]) -> None:
    values = parameters(load_excess=0.0, load_coulomb=0.05, viscous=0.01)
    load = np.array([-10.0, 0.0, 4.0])
    gain = LoadDependent.linearize(
        values, at("motor"), Motion(velocity_rms=3.0, sine_speed=8.0, load=load)
    ).damping
    np.testing.assert_allclose(
        gain, equivalent_damping(3.0, 8.0, 0.5 + 0.05 * np.abs(load), 0.01, 0.5), rtol=1e-4
    )


def test_the_excess_adds_more_to_the_gain_of_small_motions(at: Callable[..., Place]) -> None:
    """In Gaussian motion much slower than v_S it counts in full, much faster hardly: against its regression."""
    values, rng, n = parameters(), np.random.default_rng(7), 400_000
    for rms in (0.5, 60.0):
        speed = rms * rng.standard_normal(n)
        columns = LoadDependent.regressor(NONE, speed, np.full(n, -5.0), values, at("motor"))
        torque = sum(
            columns[row.name] * values[k]
            for k, row in enumerate(LoadDependent.parameters)
            if row.name in columns
        )
        product = torque * speed / rms**2
        gain = LoadDependent.linearize(values, at("motor"), Motion(velocity_rms=rms, load=-5.0)).damping
        assert float(gain) == pytest.approx(product.mean(), abs=5 * product.std() / np.sqrt(n))


def test_the_regressor_times_the_parameters_is_the_force(at: Callable[..., Place]) -> None:
    values, speed, load = parameters(viscous=0.02), np.linspace(-9, 9, 37), np.linspace(-6, 8, 37)
    columns = LoadDependent.regressor(NONE, speed, load, values, at("motor"))
    total = sum(
        columns[row.name] * values[k] for k, row in enumerate(LoadDependent.parameters) if row.name in columns
    )
    expected = [law(v, w, values)[0] for v, w in zip(speed, load, strict=True)]
    np.testing.assert_allclose(total, expected, rtol=1e-12, atol=1e-14)
