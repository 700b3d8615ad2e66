"""The trajectory that tells the parameters of a rigid robot best, within its limits.

Random trajectories first; from the best of them L-BFGS goes downhill on an augmented Lagrangian (Bertsekas 1982):
a criterion of the identification's regressor (`excitation_criteria`), and the limits at the instants of a grid as
constraints. What is left over of these is taken away by shrinking the motion (`fourier_trajectory.fitted`).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.estimation.excitation.criteria import cost
from robid_core.estimation.excitation.fourier_trajectory import (
    Limits,
    TrajectoryProblem,
    fitted,
    gram_of,
    random_coefficients,
)
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque_regressor

GRID = 12  # instants per period and harmonic on which the search looks
# In the search Coulomb friction turns over this share of the speed limit: a step has no slope to follow.
TURNOVER = 0.02
FIRST_PENALTY, PENALTY_GROWTH = 10.0, 5.0  # on squares of what is beyond a limit, as a share of its range
SHARPNESS = (1.0, 2.0, 4.0, 8.0, 16.0)  # of the condition number, one for each round of the multipliers
ROUNDS = len(SHARPNESS)


@dataclass(frozen=True)
class Trajectory:
    """The result of a search: coefficients (n_axis, n_motion), their cost, and that of the best random trajectory."""

    coefficient: FloatArray
    cost: float
    random_cost: float
    evaluations: int


def search(
    problem: TrajectoryProblem,
    generator: np.random.Generator,
    draws: int,
    starts: int,
    evaluations: int,
    progress: Callable[[int], None] = lambda done: None,
) -> Trajectory:
    """Best trajectory found within the limits.

    Parameters
    ----------
    problem
        What is wanted.
    generator
        Draws the random trajectories.
    draws
        Random trajectories that are tried.
    starts
        The best of them from which the search goes downhill.
    evaluations
        Criteria evaluated in all, those of the random trajectories included.
    progress
        Is told the number of evaluations done.
    """
    candidates = []
    for number in range(draws):
        coefficient = random_coefficients(problem, generator)
        candidates.append((problem.cost(coefficient), coefficient))
        progress(number + 1)
    candidates.sort(key=lambda pair: pair[0])
    random_cost, done = candidates[0][0], draws
    for _, start in list(candidates[: max(starts, 1)]):
        budget = (evaluations - draws) // max(starts, 1)
        if budget < ROUNDS or not start.any():
            continue
        found, count = improved(problem, start, budget, functools.partial(_from, progress, done))
        candidates.append((problem.cost(found), found))
        done += count
    value, coefficient = min(candidates, key=lambda pair: pair[0])
    return Trajectory(coefficient, value, random_cost, done)


def _from(progress: Callable[[int], None], base: int, done: int) -> None:
    progress(base + done)


def improved(
    problem: TrajectoryProblem,
    start: FloatArray,
    evaluations: int,
    progress: Callable[[int], None] = lambda done: None,
) -> tuple[FloatArray, int]:
    """A better trajectory downhill from `start`, within the limits, and the evaluations it took.

    Where the search finds none that is better within them, it is `start` itself, fitted into them.
    """
    descent = _Descent(problem, start, evaluations, progress)
    both = fitted(problem, start), fitted(problem, descent.run())
    return min(both, key=problem.cost), descent.count


class _Descent:
    """Augmented Lagrangian of one start; unknowns are coefficients over their size at the start."""

    def __init__(
        self, problem: TrajectoryProblem, start: FloatArray, budget: int, progress: Callable[[int], None]
    ) -> None:
        turnover = np.maximum(problem.drives.friction_speed, TURNOVER * problem.limits.speed)
        turnover = np.where(np.isfinite(turnover), turnover, problem.drives.friction_speed)
        self.problem = replace(problem, drives=replace(problem.drives, friction_speed=turnover))
        self.basis = problem.basis(GRID * problem.harmonics)
        self.size = np.sqrt(np.mean(start**2, axis=1, keepdims=True))
        self.size = np.where(self.size > 0, self.size, 1.0)
        self.start, self.budget, self.progress, self.count = start, budget, progress, 0
        self.multiplier: list[FloatArray] | None = None
        self.penalty, self.sharpness = FIRST_PENALTY, SHARPNESS[0]

    def run(self) -> FloatArray:
        """Coefficients after a few rounds; they may break the limits a little."""
        unknown = (self.start / self.size).ravel()
        for number in range(ROUNDS):
            left = (self.budget - self.count) // (ROUNDS - number)
            if left < 1:
                break
            before, self.sharpness = self.count, SHARPNESS[number]
            result = scipy.optimize.minimize(
                self.value_and_slope,
                unknown,
                jac=True,
                method="L-BFGS-B",
                options={"maxfun": left, "maxcor": 20},
            )
            unknown = result.x
            excess = self._excess(*self._motion(unknown)[1:])
            self.multiplier = [
                np.maximum(old + self.penalty * e, 0.0)
                for old, e in zip(self._multipliers(excess), excess, strict=True)
            ]
            self.penalty *= PENALTY_GROWTH
            self.progress(self.count)
            if self.count == before:
                break
        found: FloatArray = unknown.reshape(self.problem.shape) * self.size
        return found

    def _motion(
        self, unknown: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Regressor, and motion and torque on the grid."""
        position, speed, acceleration = self.basis.motion(unknown.reshape(self.problem.shape) * self.size)
        position = position + self.problem.centre
        regressor = motor_torque_regressor(self.problem.drives, position, speed, acceleration)
        return regressor, position, speed, acceleration, regressor @ self.problem.drives.parameters

    def _excess(
        self, position: FloatArray, speed: FloatArray, acceleration: FloatArray, torque: FloatArray
    ) -> list[FloatArray]:
        """How far each quantity is beyond each limit, as a share of its range, (n_time, n_axis) each; < 0 inside."""
        limits, joint = self.problem.limits, position @ self.problem.drives.gear.T
        pairs = (
            (position, limits.lower, limits.upper),
            (joint, limits.joint_lower, limits.joint_upper),
            (speed, -limits.speed, limits.speed),
            (acceleration, -limits.acceleration, limits.acceleration),
            (torque, -limits.torque, limits.torque),
        )
        result = []
        for value, lower, upper in pairs:
            half = 0.5 * (upper - lower)
            bounded = np.isfinite(half)
            half = np.where(bounded, half, 1.0)
            result.append(np.where(bounded, (value - np.where(bounded, upper, 0.0)) / half, -1.0))
            result.append(np.where(bounded, (np.where(bounded, lower, 0.0) - value) / half, -1.0))
        return result

    def _multipliers(self, excess: list[FloatArray]) -> list[FloatArray]:
        return self.multiplier or [np.zeros_like(e) for e in excess]

    def value_and_slope(self, unknown: FloatArray) -> tuple[float, FloatArray]:
        """Augmented Lagrangian and its derivative with respect to the unknowns."""
        self.count += 1
        if self.count % 10 == 0:
            self.progress(self.count)
        problem, limits, drives = self.problem, self.problem.limits, self.problem.drives
        regressor, position, speed, acceleration, torque = self._motion(unknown)
        excess = self._excess(position, speed, acceleration, torque)
        multiplier = self._multipliers(excess)
        pressed = [np.maximum(m + self.penalty * e, 0.0) for m, e in zip(multiplier, excess, strict=True)]
        squares = sum(float((p**2).sum() - (m**2).sum()) for p, m in zip(pressed, multiplier, strict=True))
        gram = gram_of(regressor[:, :, problem.column], problem.noise, problem.column_scale)
        gram = gram if problem.before is None else gram + problem.before
        value, slope = cost(gram, problem.criterion, self.sharpness)
        value += 0.5 * squares / self.penalty
        # Derivative with respect to the regressor, from the criterion and from the torque.
        weight = 2.0 / len(regressor) / problem.noise[:, None] ** 2
        adjoint = np.zeros_like(regressor)
        chosen = regressor[:, :, problem.column] / problem.column_scale
        adjoint[:, :, problem.column] = (chosen @ slope) * weight / problem.column_scale
        push = [_pull(pressed[2 * i], pressed[2 * i + 1], half) for i, half in enumerate(_halves(limits))]
        adjoint += push[4][:, :, None] * drives.parameters
        by_state = state_slopes(drives, position, speed, acceleration, regressor, adjoint)
        on_position = by_state[0] + push[0] + push[1] @ drives.gear
        parts = (on_position, by_state[1] + push[2], by_state[2] + push[3])
        basis = (self.basis.position, self.basis.speed, self.basis.acceleration)
        by_coefficient = sum(part.T @ motion for part, motion in zip(parts, basis, strict=True))
        return value, (by_coefficient * self.size).ravel()


def _halves(limits: Limits) -> tuple[FloatArray, ...]:
    return (
        0.5 * (limits.upper - limits.lower),
        0.5 * (limits.joint_upper - limits.joint_lower),
        limits.speed,
        limits.acceleration,
        limits.torque,
    )


def _pull(above: FloatArray, below: FloatArray, half: FloatArray) -> FloatArray:
    """Derivative of the penalties of both sides with respect to the quantity; none where there is no limit."""
    pull: FloatArray = (above - below) / half  # over infinity: zero
    return pull


def state_slopes(
    drives: RigidDrives,
    position: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    regressor: FloatArray,
    adjoint: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivative of ``sum(adjoint * regressor)`` at fixed adjoint with respect to each motor's state, sample by sample.

    By forward differences of all states at once. A microradian at the joint, a millionth of the speed: the error is
    of that relative size, far above rounding (1e-10) and far below what a descent needs. In the acceleration the
    regressor is affine, and the difference exact for any step.

    Returns three arrays like `position`: by position, by speed, by acceleration.
    """
    n_sample, n_axis = position.shape
    steps = np.stack(
        [
            1e-6 / np.abs(drives.gear).max(axis=0),
            1e-6 * np.maximum(np.abs(speed).max(axis=0), 1e-3),
            np.maximum(np.abs(acceleration).max(axis=0), 1e-3),
        ]
    )
    state = np.broadcast_to(
        np.stack([position, speed, acceleration]), (3, n_axis, 3, n_sample, n_axis)
    ).copy()
    for kind in range(3):
        for axis in range(n_axis):
            state[kind, axis, kind, :, axis] += steps[kind, axis]
    moved = np.moveaxis(state, 2, 0).reshape(3, -1, n_axis)
    changed = motor_torque_regressor(drives, *moved).reshape(3, n_axis, n_sample, -1)
    change: FloatArray = np.einsum("kasp,sp->kas", changed, adjoint.reshape(n_sample, -1))
    plain = np.einsum("sp,sp->s", regressor.reshape(n_sample, -1), adjoint.reshape(n_sample, -1))
    slope = np.moveaxis((change - plain) / steps[:, :, None], 1, 2)
    return slope[0], slope[1], slope[2]
