"""Periods of signals against those they were made with, and against closed forms of the difference function."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FloatArray
from robid_core.estimation.repetition import (
    differences,
    last_change,
    repetition_of,
    shortest_lag,
    steady_repetition,
)

N = 500  # samples a period
LINES = np.array([1, 3, 4, 7, 11, 18, 29])


def motion(n_sample: int, period: float = N, n_axis: int = 2) -> FloatArray:
    """Multisines of rms 1, (n_sample, n_axis)."""
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (n_axis, len(LINES), 1))
    turns = 2 * np.pi * LINES[:, None] * np.arange(n_sample) / period
    waves: FloatArray = np.sqrt(2 / len(LINES)) * np.cos(turns + phase).sum(axis=1).T
    return waves


def noise(n_sample: int, size: float, seed: int, n_axis: int = 2) -> FloatArray:
    return size * np.random.default_rng(seed).standard_normal((n_sample, n_axis))


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_the_difference_at_a_period_is_the_share_of_the_noise(size: float) -> None:
    """Two pieces differ by twice the noise's power and hold twice that of motion and noise."""
    n_sample = 8 * N
    d = differences(motion(n_sample) + noise(n_sample, size, 1))
    share = size**2 / (1 + size**2)
    # a mean over 7 N pairs on two axes, each with the relative variance 2: 5 standard deviations
    assert d[N] == pytest.approx(share, rel=5 * np.sqrt(2 / (2 * 7 * N)))
    assert shortest_lag(d) == N


def test_what_begins_at_rest_repeats_once_it_is_settled() -> None:
    """A transient of the motion's size that dies out within a period; torques are rougher than positions."""
    n_sample = 6 * N + 123
    rung = np.exp(-np.arange(n_sample) / 60)[:, None]
    position = motion(n_sample) - motion(1) * rung + noise(n_sample, 1e-5, 2)
    torque = 30 * motion(n_sample) * (1 - rung) + noise(n_sample, 3.0, 3)
    for found in (steady_repetition(position, torque), repetition_of(torque)):
        assert found is not None
        assert found.lag == N
        assert found.is_whole
    assert last_change(position, N) == pytest.approx(np.sqrt(2) * 1e-5, rel=0.1)


def test_a_program_that_is_run_again_has_no_period_of_the_clock() -> None:
    """Begun a sample late each time, or after a pause, it repeats and is no answer to a periodic excitation."""
    once = motion(N)
    held = [np.repeat(once[-1:], extra, axis=0) for extra in (1, 5, 2, 8)]
    late = np.concatenate([piece for pause in held for piece in (once, pause)])
    found = repetition_of(late)
    assert found is not None  # it does repeat
    assert steady_repetition(late) is None


def test_the_period_of_moves_that_are_no_sines_is_found_to_the_sample() -> None:
    """Trapezes of speed of two sizes: about its minimum the difference is a parabola for a few samples only."""
    speed = np.concatenate([
        np.clip(3 - np.abs(np.linspace(-4, 4, length)), 0, 1) * size
        for length, size in ((900, 1.0), (700, -0.6), (1500, 0.8), (1300, -1.1), (840, 0.25))
    ])  # fmt: skip
    once = np.cumsum(speed - speed.mean())
    found = repetition_of(np.tile(once, 4)[: 4 * len(once) - 119, None])
    assert found is not None
    assert (found.lag, found.is_whole) == (len(once), True)


@pytest.mark.parametrize("period", [N + 0.37, 2.9 * N])
def test_a_period_between_samples_or_longer_than_half_of_the_recording_is_none(period: float) -> None:
    assert steady_repetition(motion(5 * N, period)) is None


def test_what_is_short_or_still_or_not_known_has_none() -> None:
    position = motion(4 * N)
    assert steady_repetition(position[:10]) is None
    assert steady_repetition(np.ones((4 * N, 2))) is None
    assert steady_repetition(np.full((4 * N, 2), np.nan)) is None
    assert steady_repetition(position, motion(3 * N)) is None  # of another length
    broken = position.copy()
    broken[7] = np.nan  # a sample is missing, of the torques none
    assert steady_repetition(broken, position**3) is None
    half = np.where([[True, False]], position, np.nan)
    found = steady_repetition(half)
    assert found is not None
    assert found.lag == N
