"""Gauss-Newton steps of a torque problem with the derivatives of one point."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.estimation.least_squares import levenberg_marquardt
from robid_core.residual.body_coordinates import turned_derivatives
from robid_core.residual.problem import Linearisation, TorqueProblem

STEPS = 6  # of Gauss-Newton with the derivatives of one point
DAMPING = 1e-9  # of the first step: friction functions are nearly dependent, and the torque linear in them
TRUSTED = 1.0  # of an effect's parameter, in natural scales: further away its derivative is another one
SMALL_GAIN = 1e-6  # of the cost: steps that gain less end


def minimised(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> FloatArray:
    """Take damped Gauss-Newton steps with the derivatives of one point, of effects no further than these hold.

    Those for bodies turn with the bodies' numbers where torques are linear in these: where no spring is nonlinear, and
    nothing that a motion adds to the linear model moves with them.
    """
    precision, n_free = 1 / problem.prior**2, problem.n_free
    data, turned = about.whole - np.diag(precision), _turned_derivatives(problem, point)

    latest: dict[bytes, list[FloatArray]] = {}  # a step that is taken was tried just before

    def weighted(at: FloatArray) -> list[FloatArray]:
        if at.tobytes() not in latest:
            latest.clear()
            latest[at.tobytes()] = problem.weighted(at, about.weights)
        return latest[at.tobytes()]

    def cost(at: FloatArray) -> float:
        """Infinite where no robot has such numbers, of which one bounds another: shorter steps are tried."""
        try:
            return problem.cost(at, weighted(at))
        except ConfigurationError:
            return float("inf")

    def equations(at: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        turn = np.eye(problem.n_unknown)
        turn[:n_free, :n_free] = turned(at[:n_free])
        slope = precision * at - problem.gradients(weighted(at), about).sum(axis=0) @ turn
        return cost(at), slope, turn.T @ data @ turn + np.diag(precision)

    reach, free = np.full(problem.n_unknown, np.inf), problem.free
    reach[:n_free] = [
        TRUSTED if free.robot.parameter_kind(name) == "effect" else np.inf for name in free.names
    ]
    open_end = np.full(problem.n_unknown - n_free, np.inf)
    return levenberg_marquardt(
        equations,
        cost,
        point,
        np.maximum(np.concatenate((free.lower, -open_end)), point - reach),
        np.minimum(np.concatenate((free.upper, open_end)), point + reach),
        STEPS,
        SMALL_GAIN,
        DAMPING,
    ).point


def _turned_derivatives(problem: TorqueProblem, point: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return what turns derivatives of a point into those at other coordinates, (n_free, n_free)."""
    every = range(problem.n_free) if is_bent(problem, point) else ()
    moved = {*every, *(column.index for block in problem.blocks for column in block.simulated)}
    return turned_derivatives(problem.free, point[: problem.n_free], moved)


def is_bent(problem: TorqueProblem, point: FloatArray) -> bool:
    """Whether springs are nonlinear, so that what bodies and friction do to a motion depends on how they are bent."""
    return any(robot.bending_forces for robot in problem.robots(point))
