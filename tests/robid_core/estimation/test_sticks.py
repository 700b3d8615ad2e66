"""Which samples are called sticks, against a plant that says when its friction held it."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.sticking_rotor import NOISE, STEP, run

from robid_core.estimation.sticks import sticking_axes, sticks_of


@pytest.mark.parametrize("n_period", [1, 3])
def test_all_sticks_are_found_and_little_else(n_period: int) -> None:
    """All but one in a hundred of the samples at which the rotor was held; what else is named lies beside a turn."""
    runs = [run(seed, n_period=n_period) for seed in range(4)]
    angles = [one.angle[:, None] for one in runs]
    for one, sticks in zip(runs, sticks_of(angles, sticking_axes(angles)), strict=True):
        assert sticks[one.held].mean() > 0.97
        assert sticks.mean() < 0.1
        near = np.convolve(one.held, np.ones(11), "same") > 0
        slow = np.abs(np.gradient(one.angle, STEP)) < 9 * NOISE / STEP  # by angles with all their noise
        assert (near | slow)[sticks[:, 0]].all()


@pytest.mark.parametrize("width", [0.05, 0.2, 1.0])
def test_friction_that_turns_gradually_never_sticks(width: float) -> None:
    assert not sticking_axes([run(seed, width=width).angle[:, None] for seed in range(6)]).any()


def test_experiments_in_which_an_axis_hardly_moves_are_not_asked() -> None:
    """Three in which it sticks, and nine in which it trembles by six standard deviations of its noise."""
    still = [
        6e-5 * np.sin(0.9 * np.arange(5000)) + 1e-5 * np.random.default_rng(k).normal(size=5000)
        for k in range(9)
    ]
    angles = [run(seed).angle[:, None] for seed in range(3)] + [one[:, None] for one in still]
    assert sticking_axes(angles).all()
    assert not sticking_axes(angles[3:]).any()


def test_a_stick_across_the_ends_of_a_period_is_one() -> None:
    """Periods that begin within a stick have as many samples in sticks as others."""
    angle = run(3, n_period=3).angle.reshape(3, -1).mean(axis=0)[:, None]
    sticking = np.ones(1, dtype=bool)
    (sticks,) = sticks_of([angle - angle.mean()], sticking, repeat=True)
    inside = int(np.flatnonzero(sticks)[3])
    (again,) = sticks_of([np.roll(angle - angle.mean(), -inside, axis=0)], sticking, repeat=True)
    np.testing.assert_array_equal(again, np.roll(sticks, -inside, axis=0))


def test_what_is_too_short_has_no_sticks() -> None:
    angles = [np.zeros((12, 2)), np.zeros((0, 2))]
    assert [found.shape for found in sticks_of(angles, np.ones(2, dtype=bool))] == [(12, 2), (0, 2)]
    assert not sticking_axes(angles).any()
    assert not sticks_of([], np.zeros(0, dtype=bool))
