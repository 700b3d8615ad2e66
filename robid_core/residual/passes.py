"""From start values to the minimum: the linear model first, then prescribed motions until a pass changes nothing.

What a prescribed motion adds to the linear model is held within a pass, so that passes are a fixed-point iteration; it
contracts well on stiff arms, and hardly on compliant ones under strong excitation; it is accelerated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.estimation.intervals import covariance_with_model_error, jackknife_shifts
from robid_core.estimation.least_squares import levenberg_marquardt
from robid_core.estimation.torque.weights import covariance_apart, covariance_of, whitener
from robid_core.residual.acceleration import History
from robid_core.residual.misfit import misfit
from robid_core.residual.problem import Linearisation, TorqueProblem

FloatArray = npt.NDArray[np.float64]

FIRST_LINEARISATIONS = 20  # of the linear model at most
COARSE = 0.01  # of the torque's power: variance in the first weights
SETTLED = 0.9  # of the cost: a linearisation that leaves more has found the minimum
REWEIGHED = 3  # times by what the linear model leaves
INITIAL_STATES = 8  # improvements of an unknown initial state in one pass, at most
BETTER = 0.95  # of what is left: an improvement that leaves more was the last
IMPROVED = 4  # passes that improve initial states; later ones would fit other errors of the model with them
STEPS = 6  # of Gauss-Newton with the derivatives of one point
SMALL_GAIN = 1e-6  # of the cost: steps that gain less end
ENOUGH = 0.2  # of the stated error: a pass that changes springs and effects by less is the last
DOUBTFUL = 1.1  # misfit: above it, bins are weighted by what the model leaves, not by the noise
MUCH = 0.02  # of the cost: derivatives and weights are renewed after a pass that lowered it by more
MEMORY = 4  # passes that the acceleration remembers
NUMERICAL = 3e-5  # of a parameter: what steps of integration and band limits leave, alike in all poses


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the passes ended."""

    point: FloatArray
    """Shape (n_unknown,)."""
    covariance: FloatArray
    """Of all unknowns: formal, widened by what leaving out a configuration moves and what the last pass changed."""
    changes: tuple[float, ...]
    """Of springs and effects by each pass, in stated errors."""
    contraction: float
    """What a pass leaves of a deviation, from the last two; NaN after fewer."""
    converged: bool
    """Whether the last pass changed next to nothing."""


def solve(
    problem: TorqueProblem, passes: int, model_error: float, progress: Callable[[int, int, str], None]
) -> Solution:
    """Minimise the residual.

    Parameters
    ----------
    problem
        Its blocks are renewed.
    passes
        Prescribed motions at most.
    model_error
        Of the torque, relative, beside the noise.
    progress
        Told (done, all, what).
    """
    progress(0, passes + 1, "linear model")
    point, watched = _first_pass(problem), _watched(problem)
    changes: list[float] = []
    fresh, settled, doubted = True, False, False
    for number in range(passes):
        progress(number + 1, passes + 1, "torque of the measured motion")
        if fresh:
            _renew_signals(problem, point)
        _renew(problem, point, model_error, improve=number < IMPROVED)
        if fresh:
            _renew_derivatives(problem, point)
            about, history = _linearised(problem, point, model_error, doubted), History(MEMORY)
        before = problem.cost(point, about.weights)
        found = _minimised(problem, point, about)
        gained = 1 - problem.cost(found, about.weights) / before
        covariance = _covariance(problem, found, about)
        moved = np.abs(found - point) / np.sqrt(np.diag(covariance))
        changes.append(float(moved[watched].max(initial=0.0)))
        history.add(point, found)
        contraction = history.contraction(about.whole)
        last, point = found - point, found
        # Old derivatives may find no way down where new ones do.
        settled = changes[-1] < ENOUGH and (fresh or gained > 0)
        fresh = gained > MUCH or gained <= 0
        if settled and not doubted and misfit(problem, point) > DOUBTFUL:
            settled, doubted, fresh = False, True, True
        elif settled:
            break
        if number + 1 < passes:
            point = history.next_point(about.whole)
    progress(passes + 1, passes + 1, "")
    return Solution(point, covariance + np.outer(last, last), tuple(changes), contraction, settled)


def _watched(problem: TorqueProblem) -> npt.NDArray[np.int64]:
    """Numbers of springs and effects: what the passes must not change any more."""
    kinds = [problem.free.robot.parameter_kind(name) for name in problem.free.names]
    return np.flatnonzero(np.array([kind in ("stiffness", "effect") for kind in kinds]))


def _first_pass(problem: TorqueProblem) -> FloatArray:
    """Fit springs, dampers and friction to some of the data, weighted by what is left; bodies are held.

    Of the linear model alone, but where the arm moves far: there motions are prescribed from the first step on.
    """
    part = problem.without_inertia()
    point, reweighed = np.zeros(part.n_unknown), 0
    sizes = [covariance_of(block.motion.torque_spectrum) for block in part.blocks]
    whiteners = [whitener(COARSE * size * np.eye(size.shape[-1])) for size in sizes]
    for _ in range(FIRST_LINEARISATIONS):
        for block in part.blocks:
            if block.moves_far:
                block.renew(part.free, point[: part.n_free])
                block.differentiate(part.free, point[: part.n_free])
        weights = part.weightings(point, whiteners)
        before = part.cost(point, weights)
        point = _minimised(part, point, part.linearise(point, weights))
        if part.cost(point, weights) < SETTLED * before:
            continue  # far from the minimum, what is left tells the model's error and not its kind
        if reweighed >= REWEIGHED:
            break
        whiteners = [whitener(covariance_of(residual)) for residual in part.residuals(point)]
        reweighed += 1
    kept = [problem.free.names.index(name) for name in part.free.names]
    whole = np.zeros(problem.n_unknown)
    whole[[*kept, *range(problem.n_free, problem.n_unknown)]] = point
    return whole


def _renew(problem: TorqueProblem, point: FloatArray, model_error: float, improve: bool) -> None:
    """Prescribe the motions to the robots at a point; with `improve` again from better initial states."""
    coordinates, size, robots = point[: problem.n_free], problem.friction_size(point), problem.robots(point)
    for block, robot in zip(problem.blocks, robots, strict=True):
        block.renew(problem.free, coordinates)
        if not (improve and block.initial_state_unknown):
            continue
        whitener, before = block.weight(robot, size, model_error), np.inf
        for _ in range(INITIAL_STATES):
            residual = block.residual(block.predicted(robot, coordinates, size), point[-1])
            left = float((np.abs(np.matmul(whitener, residual[..., None])) ** 2).sum())
            if left > BETTER * before:
                break
            before = left
            block.improve_initial_state(robot, residual, whitener)
            block.renew(problem.free, coordinates)


def _renew_signals(problem: TorqueProblem, point: FloatArray) -> None:
    for block in problem.blocks:
        block.renew_signals(problem.free, point[: problem.n_free])


def _renew_derivatives(problem: TorqueProblem, point: FloatArray) -> None:
    size = problem.friction_size(point)
    for block, robot in zip(problem.blocks, problem.robots(point), strict=True):
        block.renew_friction(robot, size)
        block.differentiate(problem.free, point[: problem.n_free])


def _linearised(
    problem: TorqueProblem, point: FloatArray, model_error: float, doubted: bool
) -> Linearisation:
    """Derivatives, weighted by noise and model error; by what the model leaves where that is more than it should be."""
    blocks, robots, size = problem.blocks, problem.robots(point), problem.friction_size(point)
    if doubted:
        left = zip(blocks, problem.residuals(point), strict=True)
        weights = [whitener(covariance_apart(residual, block.motion.excited)) for block, residual in left]
    else:
        weights = [
            block.weight(robot, size, model_error) for block, robot in zip(blocks, robots, strict=True)
        ]
    return problem.linearise(point, problem.weightings(point, weights))


def _minimised(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> FloatArray:
    """Take damped Gauss-Newton steps with the derivatives of one point."""
    precision, whole = 1 / problem.prior**2, about.whole

    def equations(at: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        slope = precision * at - problem.gradients(at, about).sum(axis=0)
        return problem.cost(at, about.weights), slope, whole

    open_end = np.full(problem.n_unknown - problem.n_free, np.inf)
    return levenberg_marquardt(
        equations,
        lambda at: problem.cost(at, about.weights),
        point,
        np.concatenate((problem.free.lower, -open_end)),
        np.concatenate((problem.free.upper, open_end)),
        STEPS,
        SMALL_GAIN,
    ).point


def _covariance(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> FloatArray:
    """Of all unknowns: formal, widened by what leaving out a configuration moves."""
    formal: FloatArray = np.asarray(np.linalg.inv(about.whole), dtype=np.float64)
    if len(about.matrices) > 1:
        shifts = jackknife_shifts(about.whole, problem.gradients(point, about), about.matrices)
        formal[:] = covariance_with_model_error(formal, shifts)
    floor = np.zeros(len(formal))
    floor[: problem.n_free] = NUMERICAL**2
    result: FloatArray = formal + np.diag(floor)
    return result
