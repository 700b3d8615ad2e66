"""Waves over the travel: those of a known pitch are found, of torques and of friction; noise has none."""

from __future__ import annotations

import numpy as np
import pytest

from robid_diagnosis.travel_waves import goes_one_way, waves_of

TIME = 1e-3 * np.arange(20_000)
POSITION = 0.12 * np.sin(2 * np.pi * 0.15 * TIME) + 0.1
SPEED = np.gradient(POSITION, 1e-3)


def torque(ripple: float, friction: float, seed: int = 0) -> np.ndarray:
    """A ripple of 2.5 mm, friction that waves with 80 mm, and noise of 1 N."""
    noise = np.random.default_rng(seed).standard_normal(len(TIME))
    there = ripple * np.sin(2 * np.pi * POSITION / 2.5e-3 + 0.4)
    turned = friction * np.sin(2 * np.pi * POSITION / 0.08 + 1.0) * np.sign(SPEED)
    return there + turned + noise


def test_both_kinds_of_waves_are_among_the_peaks() -> None:
    """Within a bin of the spectrum over the travel, 2 pi / 0.24 m."""
    waves = waves_of(torque(0.3, 0.3), POSITION, SPEED, 100.0)
    for pitch in (2.5e-3, 0.08):
        assert min(abs(order - 2 * np.pi / pitch) for order in waves.peaks) < 2 * np.pi / 0.24


def test_no_more_waves_are_proposed_than_a_fit_can_try_and_all_looked_at_are_counted() -> None:
    waves = waves_of(torque(0.0, 0.0), POSITION, SPEED, 100.0)
    rms = np.sqrt((SPEED**2).mean())
    assert len(waves.peaks) <= 8
    assert waves.n_independent == pytest.approx(2 * 0.24 * 100.0 / rms, rel=0.02)


def test_waves_that_pass_too_fast_for_the_band_are_not_looked_for() -> None:
    waves = waves_of(torque(0.3, 0.3), POSITION, SPEED, 5.0)
    assert max(waves.peaks) <= 2 * np.pi * 5.0 / np.sqrt((SPEED**2).mean())


def test_a_slide_that_stands_still_has_none() -> None:
    assert waves_of(torque(0.3, 0.3), np.full_like(POSITION, 0.1), SPEED, 100.0).peaks == ()


def test_orders_that_are_tried_anyhow_are_not_looked_for() -> None:
    """The shorter wave is found above twice the order of the longer one; what was not looked at is no trial."""
    lowest = 4 * np.pi / 0.08
    every, waves = (waves_of(torque(0.3, 0.3), POSITION, SPEED, 100.0, least) for least in (0.0, lowest))
    assert min(waves.peaks) > lowest
    assert min(abs(order - 2 * np.pi / 2.5e-3) for order in waves.peaks) < 2 * np.pi / 0.24
    assert every.n_independent - waves.n_independent == pytest.approx(2 * lowest / (2 * np.pi / 0.24), abs=4)


def test_a_move_one_way_shows_no_wave_that_a_vibration_would_not_show() -> None:
    """A vibration of 30 Hz at 3 rad/s is a wave of order 62.8 to all but who goes back over it, or changes speed."""
    time = np.arange(4000) / 1000
    there, both = np.full_like(time, 3.0), np.where(time < 2, 3.0, -3.0)
    assert goes_one_way(there)
    assert goes_one_way(-there)
    assert not goes_one_way(both)
    assert not goes_one_way(SPEED)
    left = np.sin(2 * np.pi * 30 * time) + 0.01 * np.random.default_rng(1).standard_normal(len(time))
    peaks = waves_of(left, 3.0 * time, there, 100.0).peaks
    assert min(abs(order - 2 * np.pi * 30 / 3) for order in peaks) < 2 * np.pi / 12
