"""Start values of the passes: the linear model fitted to some of the data, from one start or from several."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.torque.weights import covariance_of, whitener
from robid_core.residual.equivalent_springs import laws_of_springs, with_equivalent_springs
from robid_core.residual.problem import TorqueProblem
from robid_core.residual.steps import minimised
from robid_core.robot import Robot

FIRST_LINEARISATIONS = 20  # of the linear model at most
COARSE = 0.01  # of the torque's power: variance in the first weights
ALIKE = 1.05  # of the least cost: starts that ended below came to the same fit
SETTLED = 0.9  # of the cost: a linearisation that leaves more has found the minimum
REWEIGHED = 3  # times by what the linear model leaves


def best_start(
    problem: TorqueProblem,
    starts: Sequence[FloatArray],
    passes: int,
    progress: Callable[[int, int, str], None],
) -> tuple[FloatArray, int]:
    """Return the best of the linear model's fits, and how many starts came to it.

    Where springs are nonlinear, the linear model is fitted without them, too, and springs begin beside what these do,
    or as the robot file states them, whichever leaves least of a prescribed motion.
    """
    ends = []
    for number, start in enumerate(starts):
        several = f", start {number + 1} of {len(starts)}" if len(starts) > 1 else ""
        progress(0, passes + 1, f"linear model{several}")
        ends.append(_first_pass(problem, start))
    costs = np.array([cost for _, cost in ends])
    best, agree = ends[int(costs.argmin())][0], int((costs <= ALIKE * costs.min()).sum())
    labels = tuple(dict.fromkeys(label for block in problem.blocks for label in laws_of_springs(block.robot)))
    if not labels:
        return best, agree
    progress(0, passes + 1, "linear model without nonlinear springs")
    alone = _without_laws(problem, labels)
    as_told = np.concatenate((np.zeros(problem.n_free), alone[problem.n_free :]))
    ways = best, with_equivalent_springs(problem, alone, labels), as_told
    return min(ways, key=lambda point: _prescribed_cost(problem, point)), agree


def _without_laws(problem: TorqueProblem, labels: Collection[str]) -> FloatArray:
    """Return all unknowns as the linear model finds them without some laws, these as they begin."""
    own = tuple(f"effect.{label}." for label in labels)
    free = problem.free.without(lambda name: name.startswith(own))
    free = replace(free, robot=_less(free.robot, labels))
    blocks = tuple(replace(block, robot=_less(block.robot, labels)) for block in problem.blocks)
    part = replace(problem, free=free, blocks=blocks)
    point, _ = _first_pass(part, np.zeros(part.n_free))
    whole = np.zeros(problem.n_unknown)
    whole[[problem.free.names.index(name) for name in free.names]] = point[: part.n_free]
    whole[problem.n_free :] = point[part.n_free :]
    return whole


def _less(robot: Robot, labels: Collection[str]) -> Robot:
    return robot.without_effect(*(label for label in labels if label in robot.description.effects))


def _prescribed_cost(problem: TorqueProblem, point: FloatArray) -> float:
    """What the prescribed motion leaves at a point, in coarse weights."""
    for block in problem.blocks:
        block.renew(problem.free, point[: problem.n_free])
    sizes = [covariance_of(block.bending) for block in problem.blocks]
    whiteners = [whitener(COARSE * size * np.eye(size.shape[-1])) for size in sizes]
    return problem.cost(point, problem.weighted(point, problem.weightings(point, whiteners)))


def _first_pass(problem: TorqueProblem, start: FloatArray) -> tuple[FloatArray, float]:
    """Fit springs, dampers and friction to some of the data, weighted by what is left; bodies are held. With its cost.

    Of the linear model alone, but where the arm moves far: there motions are prescribed from the first step on.
    """
    part = problem.without_inertia()
    kept = [problem.free.names.index(name) for name in part.free.names]
    point, reweighed = np.concatenate((start[kept], np.zeros(part.n_unknown - part.n_free))), 0
    sizes = [covariance_of(block.bending) for block in part.blocks]
    first = whiteners = [whitener(COARSE * size * np.eye(size.shape[-1])) for size in sizes]
    for _ in range(FIRST_LINEARISATIONS):
        for block in part.blocks:
            if block.moves_far:
                block.renew(part.free, point[: part.n_free])
                block.differentiate(part.free, point[: part.n_free])
        weights = part.weightings(point, whiteners)
        before = part.cost(point, part.weighted(point, weights))
        point = minimised(part, point, part.linearise(point, weights))
        if part.cost(point, part.weighted(point, weights)) < SETTLED * before:
            continue  # far from the minimum, what is left tells the model's error and not its kind
        if reweighed >= REWEIGHED:
            break
        left = zip(part.blocks, part.residuals(point), strict=True)
        whiteners = [whitener(covariance_of(block.at_full_power(residual))) for block, residual in left]
        reweighed += 1
    whole = np.zeros(problem.n_unknown)
    whole[[*kept, *range(problem.n_free, problem.n_unknown)]] = point
    return whole, part.cost(point, part.weighted(point, part.weightings(point, first)))
