"""Rounded corners: exact outside their radius, and their means under a motion against quadrature."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from robid_core import Motion
from robid_effects.deflection import (
    describing_function_outside,
    mean_slope_outside,
    rounded_ramp,
    slow_amplitude,
)

CORNER, RADIUS = 3e-4, 1e-4


def ramp(x: float) -> tuple[float, float]:
    return rounded_ramp(x, RADIUS)


def slope_outside(x: float) -> float:
    return ramp(x - CORNER)[1] + ramp(-x - CORNER)[1]


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


@pytest.mark.parametrize("bias", [0.0, 2.5e-4, -4e-4])
@pytest.mark.parametrize("rms", [2e-5, 2e-4, 5e-3])
def test_the_mean_slope_under_a_gaussian_is_its_integral(bias: float, rms: float) -> None:
    corners = [sign * CORNER + edge for sign in (-1, 1) for edge in (-RADIUS, RADIUS)]
    ends = sorted([bias - 9 * rms, *(c for c in corners if abs(c - bias) < 9 * rms), bias + 9 * rms])
    expected = sum(
        quad(lambda x: slope_outside(x) * norm.pdf(x, bias, rms), low, high, epsabs=1e-12)[0]
        for low, high in pairwise(ends)
    )
    got = mean_slope_outside(CORNER, RADIUS, Motion(position_bias=bias, position_rms=rms))
    assert float(got) == pytest.approx(expected, abs=1e-9)


def test_sharp_corners_have_the_textbook_gain_of_a_dead_zone() -> None:
    bias, rms = 1e-4, 2e-4
    motion = Motion(position_bias=bias, position_rms=rms)
    expected = 1 - norm.cdf((CORNER - bias) / rms) + norm.cdf((-CORNER - bias) / rms)
    # The rounding is a mean over corners within r: r^2 / 6 times the curvature of Phi, at most 0.25 / s^2, twice.
    assert float(mean_slope_outside(CORNER, RADIUS, motion)) == pytest.approx(expected, abs=2 * 0.25 / 24)
    assert float(mean_slope_outside(CORNER, 1e-9, motion)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("rms", [0.0, 2e-5, 3e-4])
def test_the_mean_slope_under_sine_and_gaussian_is_the_mean_over_many_phases(rms: float) -> None:
    amplitude, bias = 1e-3, 1e-4
    motion = Motion(position_bias=bias, position_rms=rms, sine_speed=2 * amplitude, sine_omega=2.0)
    phase = 2 * np.pi * (np.arange(20_000) + 0.5) / 20_000
    about = Motion(position_bias=bias + amplitude * np.sin(phase), position_rms=rms)
    expected = mean_slope_outside(CORNER, RADIUS, about).mean()
    assert float(mean_slope_outside(CORNER, RADIUS, motion)) == pytest.approx(expected, abs=2e-4)


def test_without_motion_the_mean_slope_is_the_slope() -> None:
    for x in (0.0, 2.5e-4, -3.6e-4, 1e-3):
        got = mean_slope_outside(CORNER, RADIUS, Motion(position_bias=x))
        assert float(got) == pytest.approx(slope_outside(x), abs=1e-8)


def test_the_fields_of_a_motion_broadcast() -> None:
    motion = Motion(position_rms=np.array([[1e-4], [2e-4]]), position_bias=np.array([0.0, 1e-4, 2e-4]))
    gain = mean_slope_outside(CORNER, RADIUS, motion)
    assert gain.shape == (2, 3)
    one = mean_slope_outside(CORNER, RADIUS, Motion(position_rms=2e-4, position_bias=1e-4))
    assert gain[1, 1] == pytest.approx(float(one), rel=1e-14)


def test_a_slow_sine_of_unknown_frequency_has_no_amplitude() -> None:
    amplitude = slow_amplitude(Motion(sine_speed=np.array([3.0, 3.0]), sine_omega=np.array([0.0, 2.0])))
    np.testing.assert_array_equal(amplitude, [0.0, 1.5])


@pytest.mark.parametrize("ratio", [0.5, 0.8, 1.2, 2.0, 30.0])
def test_the_describing_function_is_the_first_harmonic(ratio: float) -> None:
    amplitude, n = ratio * CORNER, 100_000
    phase = 2 * np.pi * (np.arange(n) + 0.5) / n
    x = amplitude * np.sin(phase)
    inside = np.clip(np.abs(x) - CORNER + RADIUS, 0, 2 * RADIUS)
    torque = np.sign(x) * (inside**2 / (4 * RADIUS) + np.maximum(np.abs(x) - CORNER - RADIUS, 0))
    expected = 2 * np.mean(torque * np.sin(phase)) / amplitude
    got = describing_function_outside(amplitude, CORNER, RADIUS)
    assert float(got) == pytest.approx(expected, abs=1e-8)
