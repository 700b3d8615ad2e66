"""The torque problem: derivatives against differences, blocks that share parameters."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from robid_core import FreeParameters, Robot, chosen_names
from robid_core.estimation.torque.periodic import PeriodicMotion, periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual import PeriodicBlock, TorqueProblem
from robid_core.residual.derivatives import derivatives

T, N = 1e-3, 2000
LAWS = SpeedFunctions.of_widths((0.5, 5.0), 6)
POSES = np.array([[0.3, 0.4, -0.3, 0.5, 0.6, 0.2], [-0.7, -0.2, 0.5, -0.9, -0.5, 1.0]])
NOUNS = (
    "*_stiffness.*", "*_damping.*", "friction.*.viscous", "mass.*", "centre_of_mass.*", "inertia.*", "rotor_inertia.*"
)  # fmt: skip


@pytest.fixture(scope="module")
def robot() -> Robot:
    nominal = Robot.load("six_axis")
    return nominal.with_parameters(
        {name: 0.0 for name in nominal.layout if name.endswith((".coulomb", ".offset"))}
    )


def motion_of(robot: Robot, poses: np.ndarray, seed: int) -> PeriodicMotion:
    """Angles of three random lines an axis about some poses, torques of noise."""
    generator, time = np.random.default_rng(seed), T * np.arange(N)
    shape = (len(poses), 1, 1, 2, N, robot.n_axis)
    angle = np.zeros(shape)
    for bin_ in (9, 41, 130):
        phase = generator.uniform(0, 2 * np.pi, (len(poses), robot.n_axis))
        wave = np.sin(2 * np.pi * bin_ / (N * T) * time[:, None] + phase[:, None])
        angle += (2.0 / bin_ * wave)[:, None, None, None]
    angle += robot.motor_angle(poses)[:, None, None, None, None]
    torque = generator.standard_normal(shape)
    return periodic_motion_of(angle, torque, T, np.array([9, 41, 130]), 80.0)


def problem_of(robot: Robot, *motions: PeriodicMotion, each_delay: bool = False) -> TorqueProblem:
    free = FreeParameters.of_robot(robot, chosen_names(list(robot.layout), NOUNS))
    blocks = tuple(PeriodicBlock.of_record(robot, motion, LAWS) for motion in motions)
    return TorqueProblem(free, blocks, LAWS.names, each_delay=each_delay)


@pytest.mark.parametrize("each_delay", [False, True])
def test_derivatives_are_differences_of_the_residual(robot: Robot, each_delay: bool) -> None:
    """For every spring, damper, friction, inertial number, friction function and delay; the mean torque too."""
    problem = problem_of(robot, motion_of(robot, POSES, 1), each_delay=each_delay)
    point = np.zeros(problem.n_unknown)
    point[problem.n_free :] = 0.01 * np.random.default_rng(2).standard_normal(
        problem.n_unknown - problem.n_free
    )
    point[-1] = 2e-4
    (block,) = problem.blocks
    (predicted,) = problem.predicted(point)
    late = np.exp(-1j * block.motion.omega[:, None] * problem.delay(point)) * predicted
    block.motion = dataclasses.replace(block.motion, torque_spectrum=late)
    columns = derivatives(block, problem.free, point[: problem.n_free], predicted, each_delay)
    found = np.stack([np.concatenate(list(runs)) for runs in columns]).transpose(4, 0, 2, 1, 3)
    for i, name in enumerate((*problem.free.names, *problem.nuisance_names())):
        h = 1e-7 if name.startswith("torque_delay") else 1e-3
        ends = []
        for sign in (1, -1):
            moved = point.copy()
            moved[i] += sign * h
            ends.append(problem.residuals(moved)[0])
        expected = (ends[1] - ends[0]) / (2 * h)
        size = abs(expected).max()
        # The equilibrium moves with springs and bodies (a factor gravity over spring stiffness, below 1 %), and images
        # of a held torque are not in the derivative (below 1e-3).
        assert abs(found[i] - expected).max() < 0.02 * size + 1e-9, name


def test_two_blocks_are_one_problem(robot: Robot) -> None:
    """Cost, gradients and normal equations of two records are sums; unknowns are shared, the prior counts once."""
    motions = [motion_of(robot, POSES[[k]], 3 + k) for k in range(2)]
    both, alone = problem_of(robot, *motions), [problem_of(robot, motion) for motion in motions]
    point = 0.01 * np.random.default_rng(4).standard_normal(both.n_unknown) * both.prior
    weights = [np.tile(np.eye(6, dtype=complex), (len(motion.bin), 1, 1)) for motion in motions]
    prior = 0.5 * ((point / both.prior) ** 2).sum()
    weightings = [p.weightings(point, [w]) for p, w in zip(alone, weights, strict=True)]
    parts = [p.weighted(point, w) for p, w in zip(alone, weightings, strict=True)]
    whole = both.weighted(point, both.weightings(point, weights))
    costs = [p.cost(point, part) for p, part in zip(alone, parts, strict=True)]
    assert both.cost(point, whole) == pytest.approx(sum(costs) - prior, rel=1e-12)
    about = both.linearise(point, both.weightings(point, weights))
    own = [p.linearise(point, w) for p, w in zip(alone, weightings, strict=True)]
    np.testing.assert_allclose(about.matrices, np.concatenate([one.matrices for one in own]), rtol=1e-9)
    gradients = [p.gradients(part, one) for p, part, one in zip(alone, parts, own, strict=True)]
    np.testing.assert_allclose(both.gradients(whole, about), np.concatenate(gradients), rtol=1e-9, atol=1e-9)


def test_the_gradient_is_the_slope_of_the_cost(robot: Robot) -> None:
    """A property of the whole: weights, counts of bins, mirror images, prior; along one random direction."""
    problem = problem_of(robot, motion_of(robot, POSES, 5))
    generator = np.random.default_rng(6)
    point, way = (0.01 * generator.standard_normal(problem.n_unknown) * problem.prior for _ in range(2))
    way[-1] = point[-1] = 0.0
    weights = problem.weightings(
        point, [np.tile(np.eye(6, dtype=complex), (len(problem.blocks[0].motion.bin), 1, 1))]
    )
    slopes = problem.gradients(problem.weighted(point, weights), problem.linearise(point, weights))
    gradient = point / problem.prior**2 - slopes.sum(axis=0)
    h = 1e-3
    ahead, behind = (
        problem.cost(at, problem.weighted(at, weights)) for at in (point + h * way, point - h * way)
    )
    slope = (ahead - behind) / (2 * h)
    assert gradient @ way == pytest.approx(slope, rel=0.02)


@pytest.mark.parametrize(
    ("use", "on", "values"),
    [
        ("friction.dahl", "axis_4", {"coulomb": 0.01, "stiffness": 1.0}),
        ("structure.foundation_sway", None, {"stiffness_x": 1e9, "stiffness_y": 1e9}),
    ],
)
def test_motions_go_on_from_those_of_a_robot_without_the_effect(
    robot: Robot, use: str, on: str | None, values: dict[str, float]
) -> None:
    """Bearings ring for seconds. A problem that goes on has at once what another has after many motions."""
    motion = motion_of(robot, POSES[:1], 5)
    changed = robot.with_effect("more", use, on, None, values)
    before, fresh, goes_on, late = (problem_of(one, motion) for one in (robot, *3 * [changed]))
    for problem, n in ((before, 12), (fresh, 1), (late, 12)):
        for _ in range(n):
            problem.blocks[0].renew(problem.free, np.zeros(problem.n_free))
    goes_on.go_on_from(before)
    goes_on.blocks[0].renew(goes_on.free, np.zeros(goes_on.n_free))
    rung_out = late.blocks[0].remainder
    left = [np.linalg.norm(one.blocks[0].remainder - rung_out) for one in (goes_on, fresh)]
    assert left[0] < 0.05 * left[1]


def test_a_derivative_is_taken_on_the_side_where_there_is_a_robot(robot: Robot) -> None:
    """LuGre friction asks that breakaway is not below Coulomb: where both are equal, each has one side only."""
    levels = {"coulomb": 0.01, "breakaway": 0.01 * (1 + 1e-6), "stribeck_speed": 1.0, "stiffness": 1.0}
    whole = robot.with_effect("bristles", "friction.lugre", "axis_4", "motor", levels)
    names = ("effect.bristles.coulomb", "effect.bristles.breakaway")
    block = PeriodicBlock.of_record(whole, motion_of(whole, POSES[:1], 6), LAWS)
    problem = TorqueProblem(FreeParameters.of_robot(whole, names), (block,), LAWS.names)
    for _ in range(6):
        block.renew(problem.free, np.zeros(2))
    block.differentiate(problem.free, np.zeros(2))
    # A greater level of either takes more torque of the motor where it slides: along its speed.
    speed = block.motion.acceleration_spectrum[..., 3] / (1j * np.maximum(block.motion.omega, 1e-9))
    for column in block.simulated:
        assert (column.remainder[..., 3] * speed.conj()).real.sum() > 0
