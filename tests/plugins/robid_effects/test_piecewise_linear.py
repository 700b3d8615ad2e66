"""The catalogue's stiffness curve: its corner points, its own example, symmetry."""

import numpy as np
import pytest
from scipy.optimize import brentq

from robid_core import ConfigurationError
from robid_effects.piecewise_linear import CLOSING, ROUNDING, PiecewiseLinear

K1, K2, K3, T1, T2 = 6.7e4, 1.1e5, 1.2e5, 29.0, 108.0
LOST_MOTION = 2.9e-4  # one arc minute
SPRING = 9e4


def parameters(lost_motion: float = LOST_MOTION) -> np.ndarray:
    return np.array([K1, K2, K3, T1, T2, lost_motion])


def slopes(
    position: float, values: np.ndarray, place, velocity: float = 0.1, step: float = 0.0
) -> tuple[float, float, float]:
    arguments = PiecewiseLinear.arguments(values, place)
    return PiecewiseLinear.law(position, velocity, 0.0, np.zeros(1), np.zeros(1), arguments, step)


def torque(position: float, values: np.ndarray, place) -> float:
    return slopes(position, values, place)[0] + place.stiffness * position


def angle(load: float, lost_motion: float) -> float:
    """Equations 23.1 to 23.3 of the catalogue, with the play in series."""
    size = abs(load)
    elastic = min(size, T1) / K1 + max(min(size, T2) - T1, 0) / K2 + max(size - T2, 0) / K3
    return np.sign(load) * (elastic + 0.5 * lost_motion * min(size / (CLOSING * T2), 1))


@pytest.fixture
def place(at):
    return at("gear", stiffness=SPRING)


def test_the_catalogues_example_comes_out(place) -> None:
    """HFUC-32-100-2UH at 60 N m: 7.15e-4 rad, 2.5 arc minutes."""
    found = brentq(lambda x: torque(x, parameters(0.0), place) - 60.0, 0.0, 0.01, xtol=1e-16)
    assert found == pytest.approx(7.15e-4, abs=0.005e-4)


@pytest.mark.parametrize("lost_motion", [0.0, LOST_MOTION])
@pytest.mark.parametrize("load", [-400.0, -60.0, -2.0, 1.0, 10.0, 60.0, 100.0, 150.0])
def test_the_torsion_is_the_catalogues_away_from_corners(place, load: float, lost_motion: float) -> None:
    found = brentq(lambda x: torque(x, parameters(lost_motion), place) - load, -0.01, 0.01, xtol=1e-16)
    assert found == pytest.approx(angle(load, lost_motion), rel=1e-9)


@pytest.mark.parametrize("lost_motion", [0.0, LOST_MOTION])
def test_the_curve_goes_through_its_corners_but_for_their_rounding(place, lost_motion: float) -> None:
    """At a corner the rounded ramp is radius / 4 above: rise * radius / 4, the radius 2 % of the shorter piece."""
    first = T1 / K1 - CLOSING * T2 / K1
    for load, rise, piece in (
        (T1, K2 - K1, min(first, (T2 - T1) / K2)),
        (T2, K3 - K2, (T2 - T1) / K2),
    ):
        got = torque(angle(load, lost_motion), parameters(lost_motion), place)
        assert got - load == pytest.approx(rise * ROUNDING * piece / 4, rel=1e-6)
        assert got == pytest.approx(load, rel=4e-3)


def test_the_curve_is_odd_rises_everywhere_and_does_not_jump(place) -> None:
    values = parameters()
    half = np.linspace(0, 3e-3, 3001)
    grid = np.concatenate((-half[:0:-1], half))
    force = np.array([torque(x, values, place) for x in grid])
    np.testing.assert_array_equal(force, -force[::-1])
    rise = np.diff(force) / np.diff(grid)
    # Mean slopes lie between that inside the play and the steepest piece.
    inside = 1 / (1 / K1 + 0.5 * LOST_MOTION / (CLOSING * T2))
    assert rise.min() == pytest.approx(inside, rel=1e-9)
    assert rise.max() == pytest.approx(K3, rel=1e-9)


@pytest.mark.parametrize("step", [0.0, 2.5e-4, 0.02])
def test_the_slopes_are_derivatives(place, step: float) -> None:
    values, h, dv = parameters(), 1e-10, 1e-6
    for x in np.random.default_rng(1).uniform(-2e-3, 2e-3, 60):
        up, down = (slopes(x + d, values, place, 0.1, step)[0] for d in (h, -h))
        faster, slower = (slopes(x, values, place, 0.1 + d, step)[0] for d in (dv, -dv))
        found = slopes(x, values, place, 0.1, step)
        # Rounding: eps * 200 N m / h; a parabola's end inside the difference: rise h / (4 radius).
        assert found[1] == pytest.approx((up - down) / (2 * h), abs=5.0)
        # Rounding: eps * 200 N m / dv.
        assert found[2] == pytest.approx((faster - slower) / (2 * dv), rel=1e-6, abs=1e-7)


def test_three_times_the_files_stiffness_is_no_difference(at) -> None:
    place = at("gear", stiffness=K1)
    values = np.array([K1, K1, K1, T1, T2, 0.0])
    for x in (-2e-3, 1e-5, 4.3e-4, 1e-3):
        # Nothing but rounding of numbers of up to 134 N m.
        assert abs(slopes(x, values, place)[0]) < 1e-12


def test_torques_in_the_wrong_order_are_refused(place) -> None:
    with pytest.raises(ConfigurationError, match="tried: torque_2 is 20 N m and torque_1 29 N m"):
        PiecewiseLinear.arguments(np.array([K1, K2, K3, T1, 20.0, 0.0]), place)
