"""What still settles is told from noise: closed forms, and a record that begins too early."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Record, Robot
from robid_core.estimation.torque.periodic import PeriodicMotion, periodic_motion_of
from robid_diagnosis.settling import ALIKE, likeness

N, T, RUNS = 2000, 1e-3, 6


def motion_of(differ: np.ndarray) -> PeriodicMotion:
    """Two periods of one axis in some experiments; the first differs by something, (RUNS, N)."""
    angle = np.zeros((1, 1, RUNS, 2, N, 1))
    angle[0, 0, :, 0, :, 0] = differ
    return periodic_motion_of(angle, np.zeros_like(angle), T, np.array([3, 5]), 100.0)


def test_noise_has_independent_bins_and_a_decay_has_not() -> None:
    """Of noise the mean of so many products of independent bins, within four standard deviations of none."""
    noise = 1e-5 * np.random.default_rng(1).standard_normal((RUNS, N))
    (alike,) = likeness([motion_of(noise)])
    assert abs(alike) < 4 * (4 / np.pi) / np.sqrt(2 * RUNS * N / 4)
    decay = 1e-3 * np.exp(-np.arange(N) * T / 0.2)
    (alike,) = likeness([motion_of(noise + decay)])
    assert alike > 0.9


def test_what_happens_at_any_time_within_a_period_is_no_settling() -> None:
    """Short pulses at all times: neighbouring bins are alike, but for a phase that says when."""
    generator = np.random.default_rng(2)
    pulses = np.zeros((RUNS, N))
    for own in pulses:
        own[generator.integers(0, N, 8)] = 1e-3
    (alike,) = likeness([motion_of(pulses)])
    assert alike < ALIKE


@pytest.mark.parametrize(("early", "settles"), [(True, True), (False, False)])
def test_a_record_that_begins_at_the_start_still_settles(
    told: Robot,
    plant_of: Callable[[Robot, int], Robot],
    measured: Callable[..., Record],
    early: bool,
    settles: bool,
) -> None:
    """From rest, and after a period that is left out."""
    record = measured(plant_of(told, 41), 42, 2, settled=not early)
    run = record.run
    motion = periodic_motion_of(
        run.values("motor_position"), run.values("motor_torque"), run.sample_time_s, np.array([3]), 100.0
    )
    (alike,) = likeness([motion])
    assert (alike > ALIKE) == settles
