"""Waves over the travel of a slide: those of a known pitch are found, of torques and of friction; noise has none."""

from __future__ import annotations

import numpy as np
import pytest

from robid_diagnosis.slide_waves import waves_of

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
