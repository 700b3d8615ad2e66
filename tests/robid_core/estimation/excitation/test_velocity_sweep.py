"""Sweeps at constant speed: what a ramp does, where plateaus are, and that they are found again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from robid_core.estimation.excitation.velocity_sweep import (
    SweepTimes,
    highest_speed,
    plan_sweep,
    plateaus,
    shift,
    smooth_step,
    sweeps_reference,
)

STEP = 1e-3
TIMES = SweepTimes(
    sample_time_s=STEP,
    acceleration=800.0,
    shortest_ramp_s=0.05,
    measured_s=0.4,
    longest_s=3.0,
    settle_s=0.1,
    settle_rad=0.5,
)
SPEEDS = (0.5, 3.0, 20.0, 90.0)


def ladder(room: float = 300.0) -> tuple[list, np.ndarray]:
    sweeps = [plan_sweep(speed, TIMES, room) for speed in SPEEDS]
    assert None not in sweeps
    return sweeps, sweeps_reference(sweeps, STEP, 0.05, TIMES.acceleration)


def test_ramps_and_moves_keep_their_acceleration_and_jerk() -> None:
    rise = np.concatenate([[0.0], smooth_step(200), [1.0]])
    assert (np.diff(rise) > 0).all()
    # Slope (1 - cos 2 pi x) / T: at most 2 / T; jerk at most 2 pi / T^2.
    assert np.diff(rise).max() <= 2 / 200
    assert np.abs(np.diff(rise, 2)).max() <= 2 * np.pi / 200**2
    move = np.concatenate([[0.0], shift(-7.0, 100, STEP), [0.0]])
    assert move.sum() * STEP == pytest.approx(-7.0, abs=1e-12)
    assert np.abs(np.diff(move)).max() / STEP <= 2 * np.pi * 7.0 / 0.1**2


def test_a_reference_starts_and_ends_at_rest_comes_back_and_keeps_its_acceleration() -> None:
    sweeps, reference = ladder()
    assert reference[0] == 0
    assert reference[-1] == 0
    assert abs(reference.sum()) < 1e-9 * np.abs(reference).max()
    assert np.abs(np.diff(reference)).max() / STEP <= TIMES.acceleration * (1 + 1e-9)
    assert np.abs(reference).max() == max(sweep.speed for sweep in sweeps)
    # Every sweep is about the middle.
    path = np.cumsum(reference) * STEP
    assert path.max() == pytest.approx(-path.min(), rel=1e-9)
    assert path.max() == pytest.approx(0.5 * max(sweep.travel(STEP) for sweep in sweeps), rel=1e-9)


def test_plateaus_are_recovered_from_the_reference_alone() -> None:
    sweeps, reference = ladder()
    found = plateaus(reference[:, None], STEP, 0.1, 0.5)
    expected = [sign * sweep.speed for sweep in sweeps for sign in (1, -1)]
    np.testing.assert_allclose([one.speed for one in found], expected, rtol=1e-12)
    assert [one.last - one.first for one in found] == [s.n_measured for s in sweeps for _ in (1, -1)]
    for one in found:
        assert np.ptp(reference[one.samples]) == 0
    np.testing.assert_allclose([reference[one.samples].mean() for one in found], expected, rtol=1e-12)


def test_settling_takes_a_time_and_an_angle() -> None:
    sweeps, _ = ladder()
    for sweep in sweeps:
        assert (sweep.n_settle - 1) * STEP < 0.1 + 0.5 / sweep.speed <= (sweep.n_settle + 1e-6) * STEP


def test_to_and_fro_pass_the_same_angles() -> None:
    _, reference = ladder()
    # The speed is held from sample to sample: the angle in the middle of each is what counts.
    angle = (np.cumsum(reference) - 0.5 * reference) * STEP
    found = plateaus(reference[:, None], STEP, 0.1, 0.5)
    for there, back in zip(found[::2], found[1::2], strict=True):
        np.testing.assert_allclose(angle[there.samples], angle[back.samples][::-1], atol=1e-9)


def test_ripple_averages_out_over_whole_turns() -> None:
    sweeps, reference = ladder()
    assert [sweep.whole_turns for sweep in sweeps] == [0, 1, 2, 6]  # 0.5 rad/s: a turn would take 12.6 s
    angle = np.cumsum(reference) * STEP
    ripple = np.cos(np.outer(angle, [1, 2, 6]) + 0.3)
    for one in plateaus(reference[:, None], STEP, 0.1, 0.5)[2:]:
        # n samples, evenly over k turns: harmonics that are no multiple of n / gcd vanish exactly.
        assert np.abs(ripple[one.samples].mean(axis=0)).max() < 1e-9


@given(st.floats(0.05, 400.0), st.floats(1.0, 500.0), st.floats(50.0, 5000.0))
@settings(max_examples=100, deadline=None)
def test_a_planned_sweep_fits_and_the_highest_speed_does(
    speed: float, room: float, acceleration: float
) -> None:
    times = SweepTimes(STEP, acceleration, 0.05, 0.4, 3.0, 0.1, 0.2)
    sweep = plan_sweep(speed, times, room)
    top = highest_speed(times, room)
    assert plan_sweep(0.999 * top, times, room) is not None
    assume(sweep is not None)
    assert sweep is not None
    profile = sweep.profile()
    assert profile.sum() * STEP == pytest.approx(sweep.travel(STEP), rel=1e-9)
    assert sweep.travel(STEP) <= room
    assert np.diff(np.concatenate([[0.0], profile, [0.0]])).max() / STEP <= acceleration * (1 + 1e-9)
    if sweep.whole_turns:
        assert sweep.n_measured * sweep.speed * STEP == pytest.approx(2 * np.pi * sweep.whole_turns)
        # n samples in place of n + d, |d| <= 1/2: n v' = (n + d) v.
        assert abs(sweep.speed / speed - 1) <= 0.5000001 / sweep.n_measured
    else:
        assert sweep.speed == speed


def test_a_reference_in_the_increments_of_a_drive_has_the_same_plateaus() -> None:
    _, reference = ladder()
    increment = 1e-4
    applied = np.rint(reference / increment) * increment
    plain = plateaus(reference[:, None], STEP, 0.1, 0.5)
    rounded = plateaus(applied[:, None], STEP, 0.1, 0.5)
    assert len(rounded) == len(plain)
    for one, other in zip(plain, rounded, strict=True):
        assert other.speed == pytest.approx(one.speed, abs=increment)
        # A ramp is within half an increment of its plateau for the last (3 increment / (4 pi^2 speed))^(1/3) of it:
        # 2.5 % of 50 samples at 0.5 rad/s, at each end. Whole turns are cut out again where there are any.
        assert abs(other.last - other.first - (one.last - one.first)) <= (1 if abs(one.speed) > 1 else 6)


def test_standstill_and_waves_are_no_plateaus() -> None:
    time = np.arange(2000) * STEP
    still = np.zeros_like(time)
    wave = 5 * np.sin(2 * np.pi * time)
    assert plateaus(np.column_stack([still, wave]), STEP, 0.0, 0.0) == ()
    constant = np.where((time > 0.5) & (time < 1.0), -7.0, 0.0)
    (one,) = plateaus(np.column_stack([still, constant]), STEP, 0.0, 0.0)
    assert (one.axis, one.speed) == (1, -7.0)
