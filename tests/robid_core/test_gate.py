"""No array passes the gate that leaves the limits, and no other array passes with its clearance."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core import MotionLimits, MotionRefused, clear_motion

T = 1e-3


def limits(n_axis: int = 1, **changes: float) -> MotionLimits:
    value = {"lower": -10.0, "upper": 10.0, "speed": 100.0, "acceleration": 1e5} | changes
    names = tuple(f"axis_{i + 1}" for i in range(n_axis))
    return MotionLimits(
        names, *(np.full(n_axis, value[k]) for k in ("lower", "upper", "speed", "acceleration"))
    )


def sine(amplitude: float, n: int = 1000) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * np.arange(n) / n)[:, None]


def test_a_clearance_covers_exactly_what_was_checked() -> None:
    start, reference = np.zeros(1), sine(5.0)
    clearance = clear_motion(start, reference, T, 3, limits())
    assert clearance.covers(start, reference, T, 3)
    changed = reference.copy()
    changed[17, 0] = np.nextafter(changed[17, 0], 10)
    assert not clearance.covers(start, changed, T, 3)
    assert not clearance.covers(start + 1e-12, reference, T, 3)
    assert not clearance.covers(start, reference, T, 4)
    assert not clearance.covers(start, reference, 2 * T, 3)


@pytest.mark.parametrize(
    ("start", "reference", "periods", "what"),
    [
        (0.0, sine(101.0), 1, "speed of the motor reaches 101 rad/s, its limit is 100"),
        (9.9, sine(5.0), 1, "upper position"),
        (-10.0, -sine(5.0), 1, "lower position"),
        (0.0, np.full((1000, 1), 4.0), 3, "upper position"),  # 4 rad per period: leaves in the third
        (0.0, np.where(np.arange(1000) < 500, 45.0, -45.0)[:, None], 1, "upper position"),
        (0.0, np.full((10, 1), np.nan), 1, "NaN"),
    ],
)
def test_what_leaves_a_limit_is_refused_by_name(
    start: float, reference: np.ndarray, periods: int, what: str
) -> None:
    with pytest.raises(MotionRefused, match=what):
        clear_motion(np.array([start]), reference, T, periods, limits())


def test_a_step_where_the_period_wraps_is_refused() -> None:
    ramp = np.linspace(0, 50, 1000)[:, None]
    with pytest.raises(MotionRefused, match="acceleration"):
        clear_motion(np.zeros(1), ramp, T, 2, limits(acceleration=1e4, upper=1e3))


@pytest.mark.parametrize("periods", [1, 3])
def test_a_motion_that_starts_or_ends_with_a_jump_is_refused(periods: int) -> None:
    cosine = 10 * np.cos(2 * np.pi * np.arange(1000) / 1000)[:, None]
    for jump in (cosine, (5 - 5 * np.cos(2 * np.pi * np.arange(1000) / 2000))[:, None]):
        with pytest.raises(MotionRefused, match="acceleration"):
            clear_motion(np.zeros(1), jump, T, periods, limits(acceleration=100.0, upper=1e3))


@settings(max_examples=200, deadline=None)
@given(
    start=st.floats(-9, 9),
    period=st.lists(st.floats(-120, 120), min_size=2, max_size=30),
    periods=st.integers(1, 4),
)
def test_whatever_is_cleared_stays_inside_when_it_is_played(
    start: float, period: list[float], periods: int
) -> None:
    reference = np.array(period)[:, None] * np.ones((1, 2))
    bounds = limits(2, upper=9.5, lower=-9.5)
    try:
        clear_motion(np.full(2, start), reference, T, periods, bounds)
    except MotionRefused:
        return
    played = np.tile(reference, (periods, 1))
    angle = start + np.cumsum(played, axis=0) * T
    assert (np.abs(played) <= bounds.speed).all()
    assert (angle <= bounds.upper + 1e-9).all()
    assert (angle >= bounds.lower - 1e-9).all()
