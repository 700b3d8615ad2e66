"""Rounded corners: exact outside their radius."""

import numpy as np
import pytest

from robid_effects.deflection import rounded_ramp

RADIUS = 1e-4


def ramp(x: float) -> tuple[float, float]:
    return rounded_ramp(x, RADIUS)


def test_the_ramp_is_exact_outside_its_radius_and_a_parabola_inside() -> None:
    assert ramp(-RADIUS) == (0.0, 0.0)
    assert ramp(-1.0) == (0.0, 0.0)
    assert ramp(0.0) == pytest.approx((RADIUS / 4, 0.5), rel=1e-14)
    for x in (RADIUS, 2.5 * RADIUS, 1.0):
        assert ramp(x) == pytest.approx((x, 1.0), rel=1e-14)


def test_the_slope_of_the_ramp_is_its_derivative() -> None:
    h = 1e-9
    for x in np.linspace(-1.7, 1.7, 18) * RADIUS:
        # A parabola at most: the central difference is exact but for rounding, eps |x| / h.
        assert ramp(x)[1] == pytest.approx((ramp(x + h)[0] - ramp(x - h)[0]) / (2 * h), abs=1e-9)
