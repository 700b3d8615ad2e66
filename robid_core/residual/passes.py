"""From start values to the minimum: the linear model first, then prescribed motions until a pass changes nothing.

What a prescribed motion adds to the linear model is held within a pass, so that passes are a fixed-point iteration; it
contracts well on stiff arms, and hardly on compliant ones under strong excitation; it is accelerated, and where passes
do not keep what they gain, what springs, dampers and bodies change of that addition is in the derivatives. A step that
the motion shows to have led astray is made again, shorter; passes that end unsettled return a point that was tried.
Derivatives are kept from pass to pass, until one gains much, or leaves more than there was: they hold no more there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.estimation.intervals import covariance_of_curves
from robid_core.estimation.scaled_inverse import scaled_inverse
from robid_core.estimation.torque.weights import covariance_apart, whitener
from robid_core.residual.acceleration import History
from robid_core.residual.linear_fit import best_start
from robid_core.residual.misfit import misfit, power_in_noise
from robid_core.residual.problem import Linearisation, TorqueProblem
from robid_core.residual.steps import is_bent, minimised
from robid_core.residual.visibility import Visibility, visibility

INITIAL_STATES = 8  # improvements of an unknown initial state in one pass, at most
BETTER = 0.95  # of what is left: an improvement that leaves more was the last
IMPROVED = 4  # passes that improve initial states; later ones would fit other errors of the model with them
ENOUGH = 0.2  # of the standard error by weights and misfit: a pass that changes springs and effects by less is the last
NEARLY = 1.0  # likewise: after such a pass one that finds no way down is the last
NEAR = 3.0  # likewise, where all derivatives are those of prescribed motions: they hardly change so near by
DOUBTFUL = 1.1  # misfit: above it, bins are weighted by what the model leaves, not by the noise
MUCH = 0.1  # of the cost: derivatives and weights are renewed after a pass that lowered it by more
KEPT = 0.3  # of the gain that derivatives promise: below, they miss what a prescribed motion does
ASTRAY = 2.0  # times the cost of the pass before, or more: what the linear model promised is not there
LOST = 1.0  # of the log-likelihood, in the noise that is left: a pass that ends so much higher had old derivatives
RETREAT = 0.3  # of such a step: so much of it is tried next, with derivatives of its own
LOOSE = 0.3  # standard deviation of a prior, in natural scales: bodies that are free must not change any more, either
MEMORY = 4  # passes that the acceleration remembers
NUMERICAL = 3e-5  # of a parameter: what steps of integration and band limits leave, alike in all poses


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of the passes of a torque residual fit."""

    point: FloatArray
    """Shape (n_unknown,)."""
    covariance: FloatArray
    """Of all unknowns: formal, widened by what leaving out a configuration moves and what the last pass changed."""
    changes: tuple[float, ...]
    """Of springs, dampers, effects and bodies without priors by each pass, in standard errors by weights and misfit."""
    contraction: float
    """To which share a pass reduces the distance to the solution, from the last two; NaN after fewer."""
    converged: bool
    """Whether the last pass changed next to nothing."""
    n_agree: int
    """Starts from which the linear model came to the best fit."""
    visibility: Visibility
    """What the data could tell, before the first pass."""


def solve(
    problem: TorqueProblem,
    passes: int,
    model_error: float,
    progress: Callable[[int, int, str], None],
    starts: Sequence[FloatArray] = (),
    *,
    begin: FloatArray | None = None,
    reweigh: bool = True,
    thorough: bool = True,
    tell: Callable[[Visibility], None] = lambda seen: None,
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
    starts
        Coordinates of the free parameters, each (n_free,), from which the linear model is fitted as well; passes go on
        from the best.
    begin
        All unknowns of a problem that differs little, (n_unknown,), from which passes go on; None: from the best fit of
        the linear model.
    reweigh
        Whether a doubtful misfit changes the weights to what the model leaves.
    thorough
        Whether derivatives that cost many motions are taken: for springs beside nonlinear ones from the first pass on,
        else where passes do not keep what they gain; for all springs and bodies, where they do not keep it then.
    tell
        Told what can be seen, before the first pass.

    Raises
    ------
    NotIdentifiable
        Where the data do not determine a spring or an effect that was not known before either.
    """
    if begin is None:
        point, agree = best_start(problem, (np.zeros(problem.n_free), *starts), passes, progress)
    else:
        point, agree = begin, 1
    for block in problem.blocks:
        block.by_motion = "bent" if thorough else "least"
    asked, loose = _asked(problem), _loose(problem)
    watched = np.union1d(asked, loose)
    changes: list[float] = []
    about: Linearisation | None = None
    best, at_best = point, list[FloatArray]()
    fresh, settled, doubted, before, gained, left = True, False, False, 0.0, 0.0, 1.0
    for number in range(passes):
        progress(number + 1, passes + 1, "torque of the measured motion")
        _renew_signals(problem, point)
        _renew(problem, point, model_error, improve=number < IMPROVED)
        if number == 0:  # before, laws on torques were asked about commands of a model without them
            _renew_signals(problem, point)
        if about is not None:
            reached = problem.cost(point, _counted(problem, problem.weighted(point, about.weights)))
            before = problem.cost(best, _counted(problem, at_best))
            if reached > ASTRAY * before:
                point, fresh = best + RETREAT * (point - best), True
                history = History(MEMORY)
                continue
            if changes[-1] > NEARLY and before - reached < KEPT * gained * before:
                better = _better_derivatives(problem, "all" if thorough else "bent")
                fresh |= thorough or better
            fresh |= reached > before + LOST * max(left, 1.0) and changes[-1] > ENOUGH
        if fresh or about is None:
            _renew_derivatives(problem, point)
            about, history = _linearised(problem, point, model_error, doubted), History(MEMORY)
            error = np.sqrt(np.diag(np.linalg.inv(about.whole) + _numerical(problem)))
        if number == 0:
            seen = visibility(problem, about)
            tell(seen)
            seen.check(np.isin(np.arange(problem.n_free), asked))
        best, at_best = point, problem.weighted(point, about.weights)
        before = problem.cost(point, at_best)
        found = minimised(problem, point, about)
        gained = 1 - problem.cost(found, problem.weighted(found, about.weights)) / before
        left = misfit(problem, found)
        moved = np.abs(found - point) / (error * max(left, 1.0) ** 0.5)
        changes.append(float(moved[watched].max(initial=0.0)))
        history.add(point, found)
        contraction = history.contraction(about.whole)
        last, point = found - point, found
        # Old derivatives may find no way down where new ones do, but not after a pass that moved next to nothing.
        exact = all(block.by_motion == "all" for block in problem.blocks)
        arrived = fresh or gained > 0 or changes[-2] < (NEAR if exact else NEARLY)
        settled = changes[-1] < ENOUGH and gained <= MUCH and arrived
        # Masses and centres of mass act by their products: derivatives of bodies that move hold nowhere else.
        fresh = gained > MUCH or gained <= 0 or loose.size > 0
        if settled and reweigh and not doubted and left > DOUBTFUL:
            settled, doubted, fresh = False, True, True
        elif settled and thorough and is_bent(problem, point) and _better_derivatives(problem, "all"):
            settled, fresh = False, True  # in a valley of nonlinear springs fewer derivatives may stand still
        elif settled:
            break
        if number + 1 < passes:
            ahead = _within(problem, history.next_point(about.whole))
            point = ahead if all(robot.is_possible for robot in problem.robots(ahead)) else found
    progress(passes + 1, passes + 1, "")
    assert about is not None
    if not settled:
        point = _better(problem, best, point, about, before, model_error)
    covariance = _covariance(problem, point, about) + np.outer(last, last)
    return Solution(point, covariance, tuple(changes), contraction, settled, agree, seen)


def _counted(problem: TorqueProblem, weighted: Sequence[FloatArray]) -> list[FloatArray]:
    """Weighted residuals of each block, zero in experiments that do not count."""
    pairs = zip(weighted, problem.blocks, strict=True)
    return [own if block.used is None else own * block.used[..., None] for own, block in pairs]


def _better(
    problem: TorqueProblem,
    best: FloatArray,
    point: FloatArray,
    about: Linearisation,
    cost: float,
    model_error: float,
) -> FloatArray:
    """Return where passes ended, or the best point before, if the motion there shows that its `cost` was less.

    What a linear model promises of a long step need not be there; the next pass would have shown it.
    """
    _renew_signals(problem, point)
    _renew(problem, point, model_error, improve=False)
    if problem.cost(point, problem.weighted(point, about.weights)) <= cost:
        return point
    _renew_signals(problem, best)
    _renew(problem, best, model_error, improve=False)
    return best


def linearise_at(
    problem: TorqueProblem,
    point: FloatArray,
    model_error: float,
    improve: bool = False,
    *,
    solved: bool = False,
) -> Linearisation:
    """Prescribe the motions to the robots at a point and differentiate there: all that a question beside a fit needs.

    Weights are the noise and a model error relative to the torque, never what the model leaves; derivatives those that
    sufficed to a solution. `improve`: initial states that nobody knows are those with which the residual is least.
    `solved`: passes have just ended there; where their last derivatives are all by prescribed motions, they are kept.
    """
    _prescribe_at(problem, point, model_error, improve)
    _renew_derivatives(problem, point, keep="all" if solved else None)
    return _linearised(problem, point, model_error, doubted=False)


def prescribe_at(
    problem: TorqueProblem, point: FloatArray, model_error: float, improve: bool = False
) -> None:
    """Prescribe the motions to the robots at a point, as `linearise_at` does, for weights that are known."""
    _prescribe_at(problem, point, model_error, improve)
    _renew_derivatives(problem, point)


def _prescribe_at(problem: TorqueProblem, point: FloatArray, model_error: float, improve: bool) -> None:
    _renew_signals(problem, point)
    _renew(problem, point, model_error, improve=improve)


def _better_derivatives(problem: TorqueProblem, by_motion: Literal["bent", "all"]) -> bool:
    """Take more derivatives by prescribed motions from now on; return whether fewer were taken before."""
    fewer = [block for block in problem.blocks if block.by_motion not in (by_motion, "all")]
    for block in fewer:
        block.by_motion = by_motion
    return bool(fewer)


def _loose(problem: TorqueProblem) -> npt.NDArray[np.int64]:
    """Numbers of what bodies and rotors weigh where no tolerance holds it."""
    kinds = np.array([problem.free.robot.parameter_kind(name) for name in problem.free.names])
    return np.flatnonzero((kinds == "inertia") & (problem.free.prior >= LOOSE))


def _asked(problem: TorqueProblem) -> npt.NDArray[np.int64]:
    """Numbers of springs, dampers and effects: what the data have to determine, and passes must not change any more."""
    kinds = [problem.free.robot.parameter_kind(name) for name in problem.free.names]
    return np.flatnonzero(np.array([kind in ("stiffness", "damping", "effect") for kind in kinds]))


def _renew(problem: TorqueProblem, point: FloatArray, model_error: float, improve: bool) -> None:
    """Prescribe the motions to the robots at a point; with `improve` again from better initial states."""
    coordinates, size, robots = point[: problem.n_free], problem.friction_size(point), problem.robots(point)
    for block, robot in zip(problem.blocks, robots, strict=True):
        block.renew(problem.free, coordinates)
        if block.used is not None:
            residual = block.residual(
                block.predicted(robot, coordinates, size), problem.delay(point), problem.sensing(point)
            )
            block.take_back(power_in_noise(block, robot, size, residual))
        if not (improve and block.initial_state_unknown):
            continue
        whitener, before = block.weight(robot, size, model_error), np.inf
        for _ in range(INITIAL_STATES):
            predicted = block.predicted(robot, coordinates, size)
            residual = block.counted(block.residual(predicted, problem.delay(point), problem.sensing(point)))
            left = float((np.abs(np.matmul(whitener, residual[..., None])) ** 2).sum())
            if left > BETTER * before:
                break
            before = left
            block.improve_initial_state(robot, residual, whitener)
            block.renew(problem.free, coordinates)


def _within(problem: TorqueProblem, point: FloatArray) -> FloatArray:
    """Return the point with the parameters within their bounds."""
    free = np.clip(point[: problem.n_free], problem.free.lower, problem.free.upper)
    return np.concatenate((free, point[problem.n_free :]))


def _renew_signals(problem: TorqueProblem, point: FloatArray) -> None:
    delay = problem.delay(point)
    for block, residual in zip(problem.blocks, problem.residuals(point), strict=True):
        block.renew_signals(problem.free, point[: problem.n_free], residual, delay)


def _renew_derivatives(problem: TorqueProblem, point: FloatArray, keep: str | None = None) -> None:
    """Take derivatives at a point; `keep`: blocks that take this kind by prescribed motions keep those they have."""
    size = problem.friction_size(point)
    for block, robot in zip(problem.blocks, problem.robots(point), strict=True):
        block.renew_friction(robot, size)
        if block.by_motion != keep:
            block.differentiate(problem.free, point[: problem.n_free])


def _linearised(
    problem: TorqueProblem, point: FloatArray, model_error: float, doubted: bool
) -> Linearisation:
    """Derivatives, weighted by noise and model error; by what the model leaves where that is more than it should be."""
    blocks, robots, size = problem.blocks, problem.robots(point), problem.friction_size(point)
    if doubted:
        left = zip(blocks, problem.residuals(point), strict=True)
        full = [(block, block.at_full_power(one)) for block, one in left]
        counted = [(block, one if block.used is None else one[block.used][None]) for block, one in full]
        weights = [whitener(covariance_apart(residual, block.motion.excited)) for block, residual in counted]
    else:
        weights = [
            block.weight(robot, size, model_error) for block, robot in zip(blocks, robots, strict=True)
        ]
    return problem.linearise(point, problem.weightings(point, weights))


def _covariance(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> FloatArray:
    """Of all unknowns: formal, widened by what leaving out a configuration moves.

    Formal in the noise that the residual shows, where that is more than the weights say: data then tell as much less
    (quasi-likelihood: Burnham and Anderson, Model Selection and Multimodel Inference, 2002, section 2.5), no priors.
    """
    weighted = problem.weighted(point, about.weights)
    counted = zip(weighted, about.weights, strict=True)
    n_row = sum(weight.count(own) for own, weight in counted)
    excess = max(1.0, sum((own**2).sum() for own in weighted) / n_row)
    priors = np.diag(1 / problem.prior**2)
    formal = scaled_inverse((about.whole - priors) / excess + priors)
    if len(about.matrices) > 1:
        gradients = problem.gradients(weighted, about)
        formal = covariance_of_curves(formal, about.whole, gradients, about.matrices, problem.friction_curves)
    return formal + _numerical(problem)


def _numerical(problem: TorqueProblem) -> FloatArray:
    """Variance that numerics leave, (n_unknown, n_unknown)."""
    floor = np.zeros(problem.n_unknown)
    floor[: problem.n_free] = NUMERICAL**2
    return np.diag(floor)
