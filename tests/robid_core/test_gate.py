"""No array passes the gate that leaves a limit, none that stays inside is refused, and no other uses its clearance.

Limits are scaled to what a motion reaches when it is played sample by sample: a hair more is accepted, a hair less
refused, for every limit and motor. Broken gates, each one line away from the real one, must not survive that.
"""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

from robid_core import MotionLimits, MotionRefused, clear_motion, gate

T = 1e-3
HAIR = 1e-9  # of the largest number in the sum; rounding of at most 60 additions is below 1e-14 of it
KINDS = ("lower", "upper", "speed", "acceleration")


def limits(n_axis: int = 1, **changes: float) -> MotionLimits:
    value = {"lower": -10.0, "upper": 10.0, "speed": 100.0, "acceleration": 1e5} | changes
    return MotionLimits(names(n_axis), *(np.full(n_axis, float(value[k])) for k in KINDS))


def names(n_axis: int) -> tuple[str, ...]:
    return tuple(f"axis_{i + 1}" for i in range(n_axis))


def sine(amplitude: float, n: int = 1000) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * np.arange(n) / n)[:, None]


# What a motion reaches, played ----------------------------------------------------------------------------


class Played(NamedTuple):
    """Motion and what it reaches of each limit, with the size of a hair there; each of shape (n_axis,)."""

    start: np.ndarray
    reference: np.ndarray
    periods: int
    reached: dict[str, np.ndarray]
    hair: dict[str, np.ndarray]


def play(start: np.ndarray, reference: np.ndarray, periods: int) -> Played:
    angle, before = [start], np.zeros_like(start)
    steps, speeds, way = [], [], np.zeros_like(start)
    for speed in [row for _ in range(periods) for row in reference]:
        steps.append(speed - before)
        speeds.append(speed)
        angle.append(angle[-1] + speed * T)
        way = way + np.abs(speed) * T
        before = speed
    steps.append(-before)
    fastest, hardest = np.abs(speeds).max(axis=0), np.abs(steps).max(axis=0) / T
    reached = {"lower": np.min(angle, axis=0), "upper": np.max(angle, axis=0)}
    reached |= {"speed": fastest, "acceleration": hardest}
    size = np.abs(start) + way + 1e-3
    hair = {"lower": HAIR * size, "upper": HAIR * size}
    hair |= {"speed": HAIR * fastest, "acceleration": HAIR * (fastest / T + hardest)}
    return Played(start, reference, periods, reached, hair)


def limited(motion: Played, kind: str, axis: int, hairs: float) -> MotionLimits:
    """Limits that are infinite, but for one that lies so many hairs outside of what the motion reaches."""
    n_axis = len(motion.start)
    values = {name: np.full(n_axis, -np.inf if name == "lower" else np.inf) for name in KINDS}
    outwards = -hairs if kind == "lower" else hairs
    values[kind][axis] = motion.reached[kind][axis] + outwards * motion.hair[kind][axis]
    return MotionLimits(names(n_axis), *(values[name] for name in KINDS))


def judge(module: Any, motion: Played) -> None:
    """Assert that a gate accepts just inside and refuses just outside each limit of each motor."""
    for kind in KINDS:
        for axis in range(len(motion.start)):
            if motion.hair[kind][axis] == 0:  # a motor that does not move reaches no speed
                continue
            call = (motion.start, motion.reference, T, motion.periods)
            module.clear_motion(*call, limited(motion, kind, axis, 1.0))
            with pytest.raises(MotionRefused, match=f"D03: axis_{axis + 1}: the commanded"):
                module.clear_motion(*call, limited(motion, kind, axis, -1.0))


SPEEDS = st.floats(-100, 100, allow_subnormal=False).map(lambda v: round(v, 3))


@st.composite
def motions(draw: st.DrawFn) -> Played:
    n_axis, n_sample = draw(st.integers(1, 3)), draw(st.integers(1, 12))
    rows = st.lists(st.lists(SPEEDS, min_size=n_axis, max_size=n_axis), min_size=n_sample, max_size=n_sample)
    start = np.array(draw(st.lists(SPEEDS, min_size=n_axis, max_size=n_axis))) / 10
    reference = np.array(draw(rows)).reshape(n_sample, n_axis)
    if draw(st.booleans()):  # a ramp: its largest step is where the period wraps
        reference = np.sort(reference, axis=0)
    return play(start, reference, draw(st.integers(1, 4)))


@settings(max_examples=150, deadline=None)
@given(motions())
def test_just_inside_is_accepted_and_just_outside_refused_at_every_limit(motion: Played) -> None:
    judge(gate, motion)


def test_a_motion_with_each_of_its_extremes_at_another_place_is_judged_at_each() -> None:
    generator = np.random.default_rng(11)
    for _ in range(40):  # long ones, where hypothesis draws short ones
        reference = generator.normal(size=(400, 2)) * [30.0, 3.0] + generator.normal(size=2)
        judge(gate, play(generator.normal(size=2), reference, int(generator.integers(1, 7))))


# Types, shapes and values ---------------------------------------------------------------------------------

ONE = np.ones((4, 1))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"start": [0.0]}, "start must be an array of float64 with 1 dimension"),
        ({"start": np.zeros((1, 1))}, "start must be"),
        ({"start": np.zeros(1, dtype=np.float32)}, "start must be"),
        ({"start": np.zeros(2)}, r"a reference of shape \(4, 1\) does not fit a start of 2 motors"),
        ({"start": np.array([np.nan])}, "NaN"),
        ({"reference": ONE[:, 0]}, "reference must be an array of float64 with 2 dimensions"),
        ({"reference": ONE.tolist()}, "reference must be"),
        ({"reference": ONE.astype(int)}, "reference must be"),
        ({"reference": ONE[:0]}, "does not fit"),
        ({"reference": np.where(np.arange(4) == 2, np.inf, 0.0)[:, None]}, "NaN or infinite"),
        ({"reference": np.ones((4, 2))}, "does not fit"),
        ({"periods": 0}, "0 is no number of periods"),
        ({"periods": -1}, "no number of periods"),
        ({"periods": 2.0}, "no number of periods"),
        ({"periods": True}, "no number of periods"),
        ({"sample_time_s": 0.0}, "0.0 is no time between samples"),
        ({"sample_time_s": -1e-3}, "no time"),
        ({"sample_time_s": np.nan}, "no time"),
        ({"sample_time_s": np.inf}, "no time"),
        ({"sample_time_s": "1e-3"}, "no time"),
        ({"sample_time_s": True}, "no time"),
        ({"limits": limits(2)}, "the lower limit must be an array of float64 with one entry for each of 1 motors"),
        ({"limits": limits(upper=np.nan)}, "the upper limit is NaN"),
        ({"limits": MotionLimits((), *(np.full(1, 9.0) for _ in KINDS))}, "0 names for 1 motors"),
        ({"limits": MotionLimits(("axis_1",), *(9.0 for _ in KINDS))}, "lower limit must be"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_what_is_no_motion_is_refused_with_the_reason(change: dict[str, Any], what: str) -> None:
    call = {"start": np.zeros(1), "reference": ONE, "sample_time_s": T, "periods": 1, "limits": limits()}
    clear_motion(**call)  # type: ignore[arg-type]
    with pytest.raises(MotionRefused, match=what):
        clear_motion(**(call | change))  # type: ignore[arg-type]


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
    assert not clearance.covers(start, reference, T, 3.9)  # type: ignore[arg-type]  # as a number it is 3
    assert not clearance.covers(start, reference.T, T, 3)
    numbers = np.arange(6.0) * 1e-3  # one motor with five samples, or two with two
    one = clear_motion(numbers[:1], numbers[1:, None], T, 3, limits())
    assert not one.covers(numbers[:2], numbers[2:].reshape(2, 2), T, 3)
    assert not clearance.covers(start, reference.astype(np.float32), T, 3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("start", "reference", "periods", "what"),
    [
        (0.0, sine(101.0), 1, "speed of the motor reaches 101 rad/s, its limit is 100"),
        (9.9, sine(5.0), 1, "upper position"),
        (-10.0, -sine(5.0), 1, "lower position"),
        (0.0, np.full((1000, 1), 4.0), 3, "upper position"),  # 4 rad per period: leaves in the third
        (0.0, np.where(np.arange(1000) < 500, 45.0, -45.0)[:, None], 1, "upper position"),
    ],
)
def test_what_leaves_a_limit_is_refused_by_name(
    start: float, reference: np.ndarray, periods: int, what: str
) -> None:
    with pytest.raises(MotionRefused, match=what):
        clear_motion(np.array([start]), reference, T, periods, limits())


# Broken gates ---------------------------------------------------------------------------------------------

MUTANTS = [
    ("drift = angle_in_period[-1] *", "drift = angle_in_period[-2] *"),
    ("* (periods - 1)", "* (periods - 2)"),
    ("* (periods - 1)", "* periods"),
    ("+ np.maximum(drift, 0)", ""),
    ("+ np.minimum(drift, 0)", ""),
    ("np.maximum(angle_in_period.max(axis=0), 0)", "np.maximum(angle_in_period[-1], 0)"),
    ("np.minimum(angle_in_period.min(axis=0), 0)", "np.minimum(angle_in_period[-1], 0)"),
    ("np.maximum(angle_in_period.max(axis=0), 0)", "angle_in_period.max(axis=0)"),
    ("np.minimum(angle_in_period.min(axis=0), 0)", "angle_in_period.min(axis=0)"),
    ("angle_in_period = np.cumsum(reference, axis=0)", "angle_in_period = np.cumsum(reference[1:], axis=0)"),
    ("prepend=rest", "prepend=reference[:1]"),
    ("append=rest", "append=reference[-1:]"),
    ("if periods > 1:", "if periods > 2:"),
    ("reference[:1] - reference[-1:]", "reference[:1] - reference[:1]"),
    ("np.abs(reference).max(axis=0)", "reference.max(axis=0)"),
    ("np.abs(reference).max(axis=0)", "np.abs(reference[:-1]).max(axis=0)"),
    ("np.abs(step).max(axis=0)", "step.max(axis=0)"),
    ("/ sample_time_s, limits.acceleration", ", limits.acceleration"),
    ("reached <= allowed", "reached <= allowed.max()"),
    ('_refuse_beyond("lower position", "rad", -lowest', '_refuse_beyond("lower position", "rad", lowest'),
]


def broken_gate(old: str, new: str) -> types.ModuleType:
    source = Path(gate.__file__).read_text(encoding="utf-8")
    assert source.count(old) == 1, f"{old!r} is no longer a line of the gate"
    module = types.ModuleType("broken_gate")
    sys.modules["broken_gate"] = module  # dataclasses look their module up
    try:
        exec(compile(source.replace(old, new), gate.__file__, "exec"), module.__dict__)
    finally:
        del sys.modules["broken_gate"]
    return module


@pytest.mark.parametrize(("old", "new"), MUTANTS)
def test_a_broken_gate_does_not_survive_the_property(old: str, new: str) -> None:
    module = broken_gate(old, new)

    @settings(max_examples=300, deadline=None, derandomize=True, phases=[Phase.generate], database=None)
    @given(motions())
    def property_holds(motion: Played) -> None:
        judge(module, motion)

    with pytest.raises((AssertionError, pytest.fail.Exception, MotionRefused, IndexError, ValueError)):
        property_holds()
