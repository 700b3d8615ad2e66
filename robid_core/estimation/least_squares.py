"""Levenberg-Marquardt for a handful of unknowns and a great many weighted complex residuals.

The residuals stay with the caller: it hands over, for a point, the cost, the gradient and the Gauss-Newton
matrix. Unknowns are logarithms of positive parameters, so that a step is a relative change. Source: Moré,
"The Levenberg-Marquardt algorithm: implementation and theory" (1978); damping by the diagonal of the Gauss-Newton
matrix makes the step independent of units. Where steps fail in a row, damping grows faster from one to the next
(Nielsen, "Damping parameter in Marquardt's method", 1999): from next to none many small factors are many costs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray

NormalEquations = Callable[[FloatArray], tuple[float, FloatArray, FloatArray]]
Cost = Callable[[FloatArray], float]

FIRST_GROWTH = 4.0  # of the damping after a step that failed; twice as much after each further one
DOWNHILL = 1e3  # damping with which a step goes along the gradient, in units of the matrix' diagonal


@dataclass(frozen=True)
class Minimum:
    """Where the iteration ended; `converged` is false when the budget ran out or no step helped any more."""

    point: FloatArray
    cost: float
    gauss_newton: FloatArray
    iterations: int
    converged: bool
    message: str


def levenberg_marquardt(
    equations: NormalEquations,
    cost: Cost,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    max_iterations: int = 60,
    tolerance: float = 1e-9,
    damping: float = 1e-3,
) -> Minimum:
    """Minimise ``0.5 * |r(x)|^2`` inside a box.

    Parameters
    ----------
    equations
        Returns (cost, gradient J^T r, Gauss-Newton matrix J^T J) at a point; real, shapes (), (n,), (n, n).
    cost
        Returns the cost alone, for trial steps.
    start, lower, upper
        First point and bounds, shape (n,).
    max_iterations
        Accepted steps at most.
    tolerance
        Ends when an accepted step predicts and brings less than this share of the cost, or when the
        projected gradient promises less.
    damping
        Of the first step, in units of the matrix' diagonal; next to none where residuals are nearly linear.
    """
    point = np.clip(start, lower, upper)
    value, gradient, matrix = equations(point)
    message = f"{max_iterations} iterations were not enough"
    for iteration in range(max_iterations):
        free = ~(((point <= lower) & (gradient > 0)) | ((point >= upper) & (gradient < 0)))
        accepted, growth = False, FIRST_GROWTH
        while damping < 1e12:
            step = _damped_step(matrix, gradient, free, damping, lower - point, upper - point)
            trial = np.clip(point + step, lower, upper)
            promised = -(gradient @ (trial - point)) - 0.5 * (trial - point) @ matrix @ (trial - point)
            steepest = damping >= DOWNHILL
            enough = tolerance * max(value, 1e-300) * (len(point) if steepest else 1)
            if promised * (1 + damping) <= enough:
                if steepest:
                    return Minimum(point, value, matrix, iteration, True, "converged")
                damping = DOWNHILL  # a step that bounds have bent may promise nothing where the gradient does
                continue
            trial_value = cost(trial)
            if np.isfinite(trial_value) and trial_value < value:
                accepted = True
                break
            damping, growth = growth * damping, 2 * growth
        if not accepted:
            message = "no step lowers the cost any more"
            break
        gain = (value - trial_value) / promised
        damping = max(damping * (0.2 if gain > 0.75 else 0.7 if gain > 0.25 else 3.0), 1e-12)
        point = trial
        value, gradient, matrix = equations(point)
    return Minimum(point, value, matrix, max_iterations, False, message)


def _damped_step(
    matrix: FloatArray,
    gradient: FloatArray,
    free: npt.NDArray[np.bool_],
    damping: float,
    below: FloatArray,
    above: FloatArray,
) -> FloatArray:
    """Solve the damped normal equations for the unknowns that are not held by a bound, within what is left to them.

    An unknown that would pass its bound goes there, and the others are solved for anew: cut off alone, a step along
    correlated unknowns may lead uphill.
    """
    step, held = np.zeros_like(gradient), ~free
    while not held.all():
        index, others = np.flatnonzero(~held), np.flatnonzero(held)
        inner = matrix[np.ix_(index, index)]
        slope = gradient[index] + matrix[np.ix_(index, others)] @ step[others]
        scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        scaled = inner / np.outer(scale, scale) + damping * np.eye(len(index))
        step[index] = -np.linalg.solve(scaled, slope / scale) / scale
        outside = ~held & ((step < below) | (step > above))
        if not outside.any():
            break
        step[outside] = np.clip(step, below, above)[outside]
        held |= outside
    return step
