"""Passes of a torque fit: where they end beside a law on the torque, and how sure they say to be."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from robid_core import FreeParameters, Robot
from robid_core.arrays import FloatArray
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual import (
    Linearisation,
    PeriodicBlock,
    TorqueProblem,
    linearise_at,
    passes,
    prescribe_at,
    solve,
)

T, N = 1e-3, 1000
LINES = np.arange(3, 96, 4)
NEXT_TO_NOTHING = 1e-9  # relative error of the model


def problem_of(robot: Robot, angle: FloatArray, torque: FloatArray, names: tuple[str, ...]) -> TorqueProblem:
    record = periodic_motion_of(angle, torque, T, LINES, 100.0)
    free = FreeParameters.of_robot(robot, names, dict.fromkeys(names, 1.0))
    laws = SpeedFunctions.near(robot.drives.friction_speed, (1.0,))
    return TorqueProblem(free, (PeriodicBlock.of_record(robot, record, laws),), laws.names)


def measured(
    robot: Robot, names: tuple[str, ...], noise: float, repeated: float, seed: int, amplitude: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles and torques of two periods, (1, 1, 1, 2, N, 1), of a robot, and its unknowns as they are.

    The torque has so much noise, relative to its rms, and so much that is the same in all periods.
    """
    generator, time, shape = np.random.default_rng(seed), T * np.arange(N), (1, 1, 1, 2, N, 1)
    waves = [3.0 / k**1.5 * np.sin(2 * np.pi * k * time / (N * T) + generator.uniform(0, 6)) for k in LINES]
    swing = amplitude * (2.0 * np.sin(2 * np.pi * time / (N * T)) + sum(waves))
    angle = np.broadcast_to(swing[:, None], shape)
    problem = problem_of(robot, angle, generator.standard_normal(shape), names)
    truth = np.zeros(problem.n_unknown)
    truth[len(names)] = robot.drives.coulomb[0]
    for _ in range(8):
        prescribe_at(problem, truth, NEXT_TO_NOTHING)
    torque = problem.blocks[0].motion.over_time(problem.predicted(truth)[0])
    size = float(torque.std())
    alike, other = (generator.standard_normal((1, 1, 1, n, N, 1)) for n in (1, 2))
    return angle, torque[:, None, :, None] + size * (repeated * alike + noise * other), truth


def test_where_a_lag_is_fitted_a_second_fit_stays() -> None:
    """At the minimum of the first, and as sure: derivatives were those beside the lag from the beginning.

    A pass moves the last parameter by less than 0.2 of its error; the formal error knows the torque to a percent.
    """
    lag = {"time_constant": 3e-4}
    robot = Robot.load("one_axis").with_effect("lag", "drive.current_loop", "axis_1", "torque", lag)
    names = (
        "effect.lag.time_constant",
        "friction.axis_1.viscous",
        "rotor_inertia.axis_1",
        "gear_stiffness.axis_1",
    )
    angle, torque, begin = measured(robot, names, 1e-3, 0.0, 7)
    problem = problem_of(robot, angle, torque, names)
    first = solve(problem, 12, NEXT_TO_NOTHING, lambda *_: None, begin=begin, reweigh=False)
    second = solve(problem, 12, NEXT_TO_NOTHING, lambda *_: None, begin=first.point, reweigh=False)
    own, other = (float(np.sqrt(one.covariance[0, 0])) for one in (first, second))
    assert abs(first.point[0] - second.point[0]) < 0.2 * other
    assert abs(own / other - 1) < 0.05


def test_errors_know_what_the_model_leaves() -> None:
    """Ten times the noise that periods differ by, alike in all of them: errors are those of four such draws.

    The rms of twelve numbers of deviation one is below 0.40 or above 1.70 once in a thousand times (chi-square).
    """
    robot, found = Robot.load("one_axis"), []
    names = ("friction.axis_1.viscous", "rotor_inertia.axis_1", "gear_stiffness.axis_1")
    for seed in range(4):
        angle, torque, truth = measured(robot, names, 1e-3, 1e-2, seed)
        problem = problem_of(robot, angle, torque, names)
        solution = solve(problem, 6, NEXT_TO_NOTHING, lambda *_: None, begin=truth, reweigh=False)
        found.append(solution.point[:3] / np.sqrt(np.diag(solution.covariance)[:3]))
    assert 0.40 < np.sqrt(np.mean(np.square(found))) < 1.70


def test_derivatives_by_motion_are_taken_once_at_a_point() -> None:
    """And kept where passes have just ended, if all are by prescribed motions; elsewhere they are taken anew."""
    robot = Robot.load("one_axis").with_effect(
        "hard", "transmission.stiffening", "axis_1", "gear", {"cubic": 1e7}
    )
    names = ("effect.hard.cubic", "rotor_inertia.axis_1", "gear_stiffness.axis_1")
    angle, torque, point = measured(robot, names, 1e-3, 0.0, 7)
    problem = problem_of(robot, angle, torque, names)
    (block,) = problem.blocks
    block.by_motion = "all"
    linearise_at(problem, point, NEXT_TO_NOTHING)
    taken, elsewhere = block.simulated, point.copy()
    assert len(taken) == len(names)
    linearise_at(problem, point, NEXT_TO_NOTHING)
    assert block.simulated is taken
    elsewhere[2] += 0.1
    linearise_at(problem, elsewhere, NEXT_TO_NOTHING, solved=True)
    assert block.simulated is taken
    linearise_at(problem, elsewhere, NEXT_TO_NOTHING)
    assert block.simulated is not taken
    block.by_motion, taken = "bent", block.simulated
    linearise_at(problem, elsewhere, NEXT_TO_NOTHING, solved=True)
    assert block.simulated is not taken


def test_derivatives_are_renewed_where_a_pass_leaves_more_than_there_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From a law of friction that falls elsewhere to the true one; led up by 11 of the log-likelihood before."""
    true = {"coulomb": 0.0, "breakaway": 0.1, "stribeck_speed": 5.0, "exponent": 1.0, "speed": 0.5}
    far = {"breakaway": 0.3, "stribeck_speed": 2.0, "exponent": 3.0}
    robot = Robot.load("one_axis").with_effect("falls", "friction.stribeck", "axis_1", "motor", true)
    free = tuple(f"effect.falls.{name}" for name in far)
    names = (
        *free,
        "friction.axis_1.viscous",
        "gear_stiffness.axis_1",
    )  # bodies without priors renew them, too
    angle, torque, begin = measured(robot, names, 1e-3, 0.0, 1, amplitude=5.0)
    wrong = robot.with_parameters(dict(zip(free, far.values(), strict=True)))
    seen = list[tuple[Linearisation, float]]()
    minimised = passes.minimised

    def watched(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> FloatArray:
        seen.append((about, problem.cost(point, problem.weighted(point, about.weights))))
        return minimised(problem, point, about)

    monkeypatch.setattr(passes, "minimised", watched)
    problem = problem_of(wrong, angle, torque, names)
    solve(problem, 12, NEXT_TO_NOTHING, lambda *_: None, begin=begin, reweigh=False)
    pairs = [(one, other) for (then, one), (now, other) in pairwise(seen) if then is now]
    assert pairs
    assert all(other <= one + 1.0 for one, other in pairs)
