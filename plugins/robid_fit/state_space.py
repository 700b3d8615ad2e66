"""Springs, dampers and viscous friction from how well a linear state-space model predicts the next sample.

The prediction-error method (L. Ljung, System Identification, 1999, chapters 4 and 7), the plain alternative in the time
domain to the fit of responses (thesis 3.1.1): the robot linearised at each pose, sampled under the held torque, in
innovations form. Its Kalman gain follows from noise that is estimated with the rest, so that a record in closed loop
leaves no bias where model and noise are right. What is not linear is in neither: Coulomb friction, an arm that moves.
Innovations that are not white tell so, and the stated errors are then those of a model that is wrong.
"""

from __future__ import annotations

import numpy as np
from pydantic import NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    ConfigurationError,
    Context,
    Doubt,
    Estimator,
    Fit,
    FloatArray,
    FreeParameters,
    ParameterTable,
    Record,
    Robot,
    chosen_names,
    pattern_problems,
)
from robid_core.estimation.information import covariance_of_parameters
from robid_core.estimation.least_squares import Minimum, levenberg_marquardt
from robid_fit.prediction_error import UNITS, PredictionErrorProblem
from robid_fit.torque_gain import common_scale_problem

UNSEEN = ("controller", "sensor", "drive")
LAGS = 20  # samples over which innovations are held against each other
WHITE = (
    4.5  # standard deviations of a correlation: among 20 lags of six axes one white record in 1000 has more
)
LEFT = 1e-3  # of the log-likelihood, that a further step promises


class StateSpaceFit(Estimator):
    """Fits a robot's linear state-space model by one-step prediction errors in the time domain.

    Example::

        fit: {use: fit.state_space, with: {free: [gear_*, bearing_*, friction.*.viscous]}}
    """

    free: tuple[str, ...] | None = None
    """Patterns of the parameters that are estimated; null: springs, dampers and viscous friction."""
    fixed: tuple[str, ...] = ()
    """Patterns of parameters that are held all the same."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations by pattern, in natural scales (0.01: one percent); wide for springs, 0.01 for bodies."""
    discard: NonNegativeInt = 0
    """Leading periods dropped as transient; initial states are estimated either way."""
    iterations: PositiveInt = 60
    """Steps at most."""

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Patterns that mean nothing in this robot, and what a linear model of its motors cannot free or has not."""
        patterns = default_patterns(robot) if self.free is None else self.free
        found = pattern_problems(
            robot, patterns, self.fixed, self.prior, lambda name: _why_not_free(robot, name)
        )
        return (
            found
            or common_scale_problem(robot, chosen_names(list(robot.layout), patterns, self.fixed))
            or _signal_problem(robot)
        )

    def run(self, record: Record, robot: Robot, context: Context) -> Fit:
        """Estimate the free parameters of the robot."""
        problem = self.problem(record, robot)
        done = 0

        def equations(point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            nonlocal done
            context.progress(min(done, self.iterations - 1), self.iterations, "predicting the samples")
            done += 1
            return problem.equations(point)

        minimum = levenberg_marquardt(
            equations,
            problem.cost,
            problem.start,
            problem.lower,
            problem.upper,
            self.iterations,
            LEFT / problem.cost(problem.start),
        )
        context.progress(self.iterations, self.iterations)
        return _result(problem, minimum, robot)

    def problem(self, record: Record, robot: Robot) -> PredictionErrorProblem:
        """Return what is minimised."""
        for place, message in self.problems_with(robot).items():
            raise ConfigurationError(f"{place[0]}: {message}")
        patterns = default_patterns(robot) if self.free is None else self.free
        free = FreeParameters.of_robot(
            robot, chosen_names(list(robot.layout), patterns, self.fixed), dict(self.prior)
        )
        return PredictionErrorProblem(free, record.training(), self.discard)


def default_patterns(robot: Robot) -> tuple[str, ...]:
    """Springs, dampers and viscous friction, as far as the robot has them."""
    names = list(robot.layout)
    nouns = ("gear_stiffness.*", "gear_damping.*", "bearing_stiffness.*", "bearing_damping.*")
    found = [noun for noun in nouns if any(name.startswith(noun[:-1]) for name in names)]
    viscous = any(name.startswith("friction.") and name.endswith(".viscous") for name in names)
    return (*found, "friction.*.viscous") if viscous else tuple(found)


def _why_not_free(robot: Robot, name: str) -> str:
    """Say why this fit cannot free a parameter; empty where it can."""
    if robot.parameter_kind(name) in UNSEEN:
        return "the linear model does not depend on it; hold it"
    if robot.parameter_kind(name) == "friction" and not name.endswith(".viscous"):
        return "a linear model has viscous friction only; leave it out"
    return ""


def _signal_problem(robot: Robot) -> dict[tuple[str | int, ...], str]:
    """Say that laws on signals are no part of the model; empty where there are none."""
    if not robot.signals:
        return {}
    message = (
        "the state space has no states for this robot's effects on torques and angles (delay, lag, ripple); take them "
        "out of the robot file, or fit with fit.torque_residual"
    )
    return {("free",): message}


def _result(problem: PredictionErrorProblem, minimum: Minimum, robot: Robot) -> Fit:
    free, n, point = problem.free, len(problem.free.names), minimum.point
    covariance = covariance_of_parameters(minimum.gauss_newton, problem.names)
    slope = problem.slope(point)
    spread = slope @ covariance @ slope.T
    estimate = problem.values(point)
    kinds = tuple(robot.parameter_kind(name) for name in free.names)
    n_noise, n_axis = len(problem.noise_names), robot.n_axis
    beside = (point <= problem.lower + 1e-9) | (point >= problem.upper - 1e-9)
    beside[n:] = False  # noise of next to nothing is no fault
    table = ParameterTable(
        names=problem.names,
        units=tuple(robot.parameter_unit(name) for name in free.names)
        + tuple(unit for unit in UNITS for _ in range(n_axis)),
        groups=kinds + ("nuisance",) * n_noise,
        start=problem.values(problem.start),
        estimate=estimate,
        standard_error=np.sqrt(np.diag(spread)),
        reported=np.array([kind in ("stiffness", "effect") for kind in kinds] + [False] * n_noise),
        at_bound=beside,
        prior=np.sqrt(((slope * problem.prior) ** 2).sum(axis=1)),
    )
    return Fit(
        method="prediction errors of the linear state-space model, Kalman gain from estimated noise",
        status=f"{minimum.message} after {minimum.iterations} iterations",
        converged=minimum.converged,
        misfit=1.0,
        misfit_against="",
        n_starts=1,
        n_agree=1,
        parameters=table,
        covariance=covariance,
        free_names=problem.names,
        stated_doubts=_colour(problem, point, robot.axis_names),
        model=robot.model(
            dict(zip(free.names, estimate[:n].tolist(), strict=True)), free.names, spread[:n, :n]
        ),
    )


def _colour(
    problem: PredictionErrorProblem, point: FloatArray, axis_names: tuple[str, ...]
) -> tuple[Doubt, ...]:
    """Doubt the model where innovations of a motor are correlated in time."""
    _, found = problem.predictions(point)
    correlation = autocorrelation([one.innovation for one in found], LAGS)
    count = sum(one.innovation.shape[0] * one.innovation.shape[1] for one in found)
    lag, axis = np.unravel_index(int(np.abs(correlation).argmax()), correlation.shape)
    if abs(correlation[lag, axis]) <= WHITE / np.sqrt(count):
        return ()
    return (
        Doubt(
            "innovations",
            f"innovations of {axis_names[axis]} are correlated by {correlation[lag, axis]:.2g} over {lag + 1} samples, "
            f"where white ones show {WHITE / np.sqrt(count):.1g} at most",
            "the linear model lacks what makes them, and the stated errors do not cover it; take off friction "
            "(compensate.friction), or fit with fit.torque_residual",
        ),
    )


def autocorrelation(lanes: list[FloatArray], n_lag: int) -> FloatArray:
    """Autocorrelation of sequences (n_sample, n_lane, n) at lags 1 to `n_lag`, shape (n_lag, n)."""
    power = np.sum([(one**2).sum(axis=(0, 1)) for one in lanes], axis=0)
    products = [
        np.sum([(one[lag:] * one[:-lag]).sum(axis=(0, 1)) for one in lanes], axis=0)
        for lag in range(1, n_lag + 1)
    ]
    result: FloatArray = np.array(products) / power
    return result
