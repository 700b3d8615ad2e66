"""A law along a motion is the law called step by step; a periodic motion has no beginning."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_core.mechanics import ForceTerm
from robid_core.mechanics.law_along import law_along, signal_along

STEP = 1e-3


def term_of(use: str, **values: float) -> ForceTerm:
    robot = Robot.load("one_axis").with_effect("tried", use, "axis_1", values=values)
    return next(term for term in robot.forces if term.label == "tried")


def motion(n_lane: int, n_sample: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Periodic angles, their speeds, and a load."""
    generator, time = np.random.default_rng(seed), np.arange(n_sample) / n_sample
    turn = 2 * np.pi * 3 * time + generator.uniform(0, 6, (n_lane, 1))
    omega = 2 * np.pi * 3 / (n_sample * STEP)
    return 0.5 * np.sin(turn), 0.5 * omega * np.cos(turn), 20 * np.cos(turn / 3)


def step_by_step(
    term: ForceTerm, inputs: tuple[np.ndarray, ...], state: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Numpy twin: outputs (3, n_lane, n_sample) and states, by calling the law from Python."""
    outputs, ends = np.empty((3, *inputs[0].shape)), []
    for lane, row in enumerate(zip(*inputs, strict=True)):
        now = state[lane].copy()
        for sample, (x, v, load) in enumerate(zip(*row, strict=True)):
            following = now.copy()
            outputs[:, lane, sample] = term.law(x, v, load, now, following, term.arguments, STEP)
            now = following
        ends.append(now)
    return outputs, np.array(ends)


@pytest.mark.parametrize("n_lane", [1, 11])
@pytest.mark.parametrize("use", ["friction.stribeck", "friction.lugre", "friction.load_dependent"])
def test_it_is_the_law_step_by_step(use: str, n_lane: int) -> None:
    term, inputs = term_of(use), motion(n_lane, 43)  # no whole number of registers
    state = np.random.default_rng(1).uniform(-0.1, 0.1, (n_lane, term.n_state))
    run = law_along(term, *inputs, STEP, state=state)
    outputs, ends = step_by_step(term, inputs, state)
    for ours, theirs in zip((run.force, run.slope_position, run.slope_velocity), outputs, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(run.state, ends)


def test_a_run_goes_on_from_the_state_it_ended_in() -> None:
    term, inputs = term_of("friction.lugre"), motion(3, 60)
    whole = law_along(term, *inputs, STEP)
    first = law_along(term, *(values[:, :25] for values in inputs), STEP)
    second = law_along(term, *(values[:, 25:] for values in inputs), STEP, state=first.state)
    np.testing.assert_array_equal(np.concatenate((first.force, second.force), axis=1), whole.force)


def test_a_periodic_motion_settles_to_the_same_force_in_every_period() -> None:
    term, inputs = term_of("friction.dahl"), motion(3, 600)
    settled, fresh = (law_along(term, *inputs, STEP, settle=settle) for settle in (300, 0))
    next_period = law_along(term, *inputs, STEP, state=settled.state)
    # Dahl's bristle forgets as exp(-sigma x / F_c), x the path: 100 N m/rad * 1 rad / 0.5 N m in half a period.
    np.testing.assert_allclose(settled.force, next_period.force, rtol=0, atol=1e-12)
    assert abs(fresh.force - settled.force).max() > 0.1


def test_a_signal_goes_through_its_law() -> None:
    ripple = {"amplitude": 0.2, "relative": 0.1, "order": 6.0}
    robot = Robot.load("one_axis").with_effect("wave", "drive.torque_ripple", "axis_1", values=ripple)
    angle, speed, torque = motion(2, 50)
    (term,) = robot.signals
    acting = signal_along(term, torque, angle, 0 * speed, 0.0)
    np.testing.assert_allclose(acting, torque + (0.2 + 0.1 * torque) * np.sin(6 * angle), rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda t, x, v, f: law_along(t, x, v[:, 1:], f, STEP), r"asked along \(3, 20\), \(3, 19\)"),
        (lambda t, x, v, f: law_along(t, x[0], v[0], f[0], STEP), "give three arrays"),
        (lambda t, x, v, f: law_along(t, x, v, f, STEP, settle=21), "21 samples to settle of 20"),
    ],
)
def test_motions_that_do_not_fit_are_refused(call: Any, told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        call(term_of("friction.lugre"), *motion(3, 20))
