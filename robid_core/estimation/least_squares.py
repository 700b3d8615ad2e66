"""Levenberg-Marquardt for a handful of unknowns and a great many weighted complex residuals.

The residuals stay with the caller: it hands over, for a point, the cost, the gradient and the Gauss-Newton
matrix. Unknowns are logarithms of positive parameters, so that a step is a relative change. Source: Moré,
"The Levenberg-Marquardt algorithm: implementation and theory" (1978); damping by the diagonal of the Gauss-Newton
matrix makes the step independent of units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray

NormalEquations = Callable[[FloatArray], tuple[float, FloatArray, FloatArray]]
Cost = Callable[[FloatArray], float]


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
    """
    point = np.clip(start, lower, upper)
    value, gradient, matrix = equations(point)
    damping, message = 1e-3, f"{max_iterations} iterations were not enough"
    for iteration in range(max_iterations):
        free = ~(((point <= lower) & (gradient > 0)) | ((point >= upper) & (gradient < 0)))
        accepted = False
        while damping < 1e12:
            step = _damped_step(matrix, gradient, free, damping)
            trial = np.clip(point + step, lower, upper)
            promised = -(gradient @ (trial - point)) - 0.5 * (trial - point) @ matrix @ (trial - point)
            if promised <= tolerance * max(value, 1e-300):
                return Minimum(point, value, matrix, iteration, True, "converged")
            trial_value = cost(trial)
            if np.isfinite(trial_value) and trial_value < value:
                accepted = True
                break
            damping *= 4.0
        if not accepted:
            message = "no step lowers the cost any more"
            break
        gain = (value - trial_value) / promised
        damping = max(damping * (0.2 if gain > 0.75 else 0.7 if gain > 0.25 else 3.0), 1e-12)
        point = trial
        value, gradient, matrix = equations(point)
    return Minimum(point, value, matrix, max_iterations, False, message)


def _damped_step(
    matrix: FloatArray, gradient: FloatArray, free: npt.NDArray[np.bool_], damping: float
) -> FloatArray:
    """Solve the damped normal equations for the unknowns that are not held by a bound."""
    step = np.zeros_like(gradient)
    index = np.flatnonzero(free)
    if len(index) == 0:
        return step
    inner = matrix[np.ix_(index, index)]
    scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    scaled = inner / np.outer(scale, scale) + damping * np.eye(len(index))
    step[index] = -np.linalg.solve(scaled, gradient[index] / scale) / scale
    return step
