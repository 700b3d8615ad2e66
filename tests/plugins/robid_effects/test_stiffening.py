"""The cubic spring: slopes, regressor."""

import numpy as np
import pytest

from robid_effects.stiffening import Stiffening

PARAMETERS = np.array([2e9])


def law(position: float) -> tuple[float, float, float]:
    return Stiffening.law(position, 0.1, 0.0, np.zeros(1), np.zeros(1), PARAMETERS, 2.5e-4)


def test_the_torque_is_cubic_and_odd() -> None:
    for x in (1e-4, 2e-3, 0.01):
        assert law(x)[0] == pytest.approx(2e9 * x**3, rel=1e-14)
        assert law(-x)[0] == -law(x)[0]


def test_the_slope_is_the_derivative() -> None:
    h = 1e-6
    for x in (-3e-3, 0.0, 1e-3):
        # Central difference of a cubic: c h^2 = 2e-3 too large.
        assert law(x)[1] == pytest.approx((law(x + h)[0] - law(x - h)[0]) / (2 * h) - 2e9 * h * h, abs=1e-5)
        assert law(x)[2] == 0.0


def test_the_regressor_times_the_parameter_is_the_force(at) -> None:
    position = np.linspace(-2e-3, 2e-3, 9)
    column = Stiffening.regressor(position, position, position, PARAMETERS, at("gear"))["cubic"]
    np.testing.assert_allclose(PARAMETERS[0] * column, [law(x)[0] for x in position], rtol=1e-13)
