"""Stiffness and damping from measured frequency responses: the thesis' fit (3.1)-(3.2), with honest weights.

The weight is the inverse of (covariance of the measured response + error of the model), the latter one number for all
robots, so that the misfit is a check. Several starts around the nominal robot; standard errors from a jackknife over
configurations (see estimation.intervals), because what a linear model leaves out is common to a configuration
and smooth over lines. Friction is a complex gain with three unknowns a motor (`friction_gain`); bodies are free on
request, within what a drawing promises.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from robid_core import (
    AxisKey,
    BoolArray,
    ComplexArray,
    ConfigurationError,
    Context,
    DataRejected,
    Estimator,
    Fit,
    FloatArray,
    FreeParameters,
    Frf,
    ParameterTable,
    ResponseComparison,
    Robot,
    chosen_names,
    pattern_problems,
)
from robid_core.estimation.information import covariance_of_parameters
from robid_core.estimation.intervals import covariance_with_model_error, jackknife_shifts
from robid_core.estimation.least_squares import Minimum, levenberg_marquardt
from robid_fit.problem import LogResponseProblem
from robid_fit.response_weights import covariance_of_logarithm
from robid_fit.slow_motion import slow_motion_gain
from robid_fit.torque_gain import common_scale_problem

# Starts stop when a thousandth of the cost is left to gain: enough to tell basins apart; the best is refined.
COARSE_TOLERANCE = 1e-3
COARSE_LINES = 3
# Dampers of none are told as this share of their spring times a second, so that they have a logarithm.
SMALLEST_DAMPING = 1e-9
# Weights and slow motion are taken at the fit before; a third time moved no spring by a tenth of its error.
RENEWALS = 2
UNSEEN = ("controller", "sensor", "drive")


class LogResponseFit(Estimator):
    """Fits springs and dampers to the logarithm of a measured response matrix (thesis 3.1, 3.2).

    Example::

        fit: {use: fit.log_response, with: {starts: 20}}
    """

    free: tuple[str, ...] | None = None
    """Patterns of the parameters that are estimated, bodies by `mass.*`, `inertia.*`; null: springs and dampers."""
    fixed: tuple[str, ...] = ()
    """Patterns of parameters that are held all the same."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations by pattern, in natural scales (0.01: one percent); wide for springs, 0.01 for bodies."""
    starts: Annotated[int, Field(ge=1, le=10_000)] = 20
    """Start points: the nominal robot and random ones around it."""
    start_spread: PositiveFloat = 0.35
    """Standard deviation of the starts' logarithms around the nominal values; never wider than the prior."""
    model_error: PositiveFloat = 2e-3
    """Relative error of the model per entry, beside the covariance."""
    coupling_share: NonNegativeFloat = 0.1
    """Share of the diagonal's size below which an entry's model error does not fall."""
    max_iterations: PositiveInt = 60
    """Accepted steps of one start at most."""

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """The controller: what a slow motion makes of a response is a matter of the closed loop."""
        return ("controller",)

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Patterns that mean nothing in this robot, and parameters that this fit cannot free."""
        patterns = default_patterns(robot) if self.free is None else self.free
        found = pattern_problems(
            robot, patterns, self.fixed, self.prior, lambda name: _why_not_free(robot, name)
        )
        return found or common_scale_problem(robot, chosen_names(list(robot.layout), patterns, self.fixed))

    def run(self, frf: Frf, robot: Robot, context: Context) -> Fit:
        """Estimate the free parameters of the robot."""
        for place, message in self.problems_with(robot).items():
            raise ConfigurationError(f"{place[0]}: {message}")
        patterns = default_patterns(robot) if self.free is None else self.free
        free = FreeParameters.of_robot(
            _damped(robot), chosen_names(list(robot.layout), patterns, self.fixed), self.prior
        )
        best, agree = self._best_start(free, frf.select("n_freq", slice(None, None, COARSE_LINES)), context)
        problem = self._problem(free, frf, frf.response)
        for _ in range(RENEWALS):
            factor = slow_motion_gain(problem.robot_at(best), frf, problem.motor_damping(best))
            problem = self._problem(free, frf, problem.model(best), factor)
            end = self._minimise(problem, best)
            best = end.point
        return self._result(robot, problem, end, agree)

    def _best_start(self, free: FreeParameters, frf: Frf, context: Context) -> tuple[FloatArray, int]:
        """Unknowns at the end of the best start, and how many starts ended there; bodies are held."""
        held = free.without(lambda name: free.robot.parameter_kind(name) == "inertia")
        problem = self._problem(held, frf, frf.response)
        points = self._start_points(problem, context.generator)
        ends = [
            self._minimise(problem, point, COARSE_TOLERANCE)
            for point in context.track(points, len(points), "starts")
        ]
        best = min(ends, key=lambda end: end.cost)
        coordinates, own = problem.parts(best.point)
        whole = np.zeros(len(free.names))
        whole[np.isin(free.names, held.names)] = coordinates
        agree = sum(end.cost < best.cost * 1.05 + 1e-9 for end in ends)
        return np.concatenate((whole, own)), agree

    def _problem(
        self, free: FreeParameters, frf: Frf, response: ComplexArray, factor: ComplexArray | float = 1.0
    ) -> LogResponseProblem:
        """Set up what is minimised; errors are relative to a response."""
        used = _usable_lines(frf)
        covariance = covariance_of_logarithm(frf, used, response, self.model_error, self.coupling_share)
        return LogResponseProblem(free, frf, covariance, used, factor)

    def _start_points(self, problem: LogResponseProblem, generator: np.random.Generator) -> list[FloatArray]:
        spread = np.minimum(self.start_spread, problem.prior)
        drawn = generator.standard_normal((self.starts - 1, len(problem.start)))
        return [problem.start, *(problem.start + spread * row for row in drawn)]

    def _minimise(self, problem: LogResponseProblem, point: FloatArray, tolerance: float = 1e-9) -> Minimum:
        return levenberg_marquardt(
            problem.equations,
            problem.cost,
            point,
            problem.lower,
            problem.upper,
            self.max_iterations,
            tolerance,
        )

    def _result(self, robot: Robot, problem: LogResponseProblem, best: Minimum, agree: int) -> Fit:
        free, names, n = problem.free, problem.names, len(problem.free.names)
        cost, gradients, matrices = problem.by_configuration(best.point)
        freedom = problem.n_told(best.point) - len(names)
        status = best.message
        seen = np.diag(matrices.sum(axis=0)) > 0
        seen[n:] = True  # nuisances that nothing shows keep their prior, and harm nothing
        total = matrices.sum(axis=0) + np.diag(1 / problem.prior**2)
        covariance = covariance_of_parameters(total, names)
        if len(gradients) >= 2:
            shifts = jackknife_shifts(total, gradients, matrices)
            covariance = covariance_with_model_error(covariance, shifts)
        known = np.minimum(
            problem.prior / np.sqrt(np.diag(covariance)), 1.0
        )  # no data take away what was known
        covariance = covariance * np.outer(known, known)
        slope = problem.slope(best.point)
        spread = slope @ covariance @ slope.T
        kinds = tuple(robot.parameter_kind(name) for name in free.names)
        n_nuisance = len(names) - n
        estimate = problem.values(best.point)
        table = ParameterTable(
            names=names,
            units=tuple(robot.parameter_unit(name) for name in free.names) + ("1",) * n_nuisance,
            groups=kinds + ("nuisance",) * n_nuisance,
            start=problem.values(problem.start),
            estimate=estimate,
            standard_error=np.where(seen, np.sqrt(np.diag(spread)), np.nan),
            reported=np.array([kind in ("stiffness", "effect") for kind in kinds] + [False] * n_nuisance),
            at_bound=(best.point <= problem.lower * (1 - 1e-9)) | (best.point >= problem.upper * (1 - 1e-9)),
            prior=np.sqrt(((slope * problem.prior) ** 2).sum(axis=1)),
        )
        return Fit(
            method="log response, weights from covariance and model error",
            status=status,
            converged=best.converged,
            misfit=2 * cost / float(freedom),
            n_starts=self.starts,
            n_agree=agree,
            parameters=table,
            covariance=covariance,
            free_names=names,
            response=_comparison(problem, best.point),
            misfit_against=f"covariance and a model error of {100 * self.model_error:.2g} %",
            model_error=self.model_error,
            model=robot.model(
                dict(zip(free.names, estimate[:n].tolist(), strict=True)), free.names, spread[:n, :n]
            ),
        )


def default_patterns(robot: Robot) -> tuple[str, ...]:
    """Springs and dampers, as far as the robot has them."""
    heads = {name.partition(".")[0] for name in robot.layout}
    nouns = ("gear_stiffness", "gear_damping", "bearing_stiffness", "bearing_damping")
    return tuple(f"{noun}.*" for noun in nouns if noun in heads)


def _why_not_free(robot: Robot, name: str) -> str:
    """Say why this fit cannot free a parameter; empty where it can."""
    if robot.parameter_kind(name) in UNSEEN:
        return "the response does not depend on it; hold it"
    if robot.parameter_kind(name) == "friction":
        return "three unknowns of each motor stand in its place; leave it out"
    return ""


def _damped(robot: Robot) -> Robot:
    """Return a robot in which every damper has a logarithm."""
    stiffness, damping = robot.spring_arrays()
    pairs = zip(robot.damping_names, stiffness.tolist(), damping.tolist(), strict=False)
    return robot.with_parameters({name: max(d, SMALLEST_DAMPING * k) for name, k, d in pairs})


def _comparison(problem: LogResponseProblem, point: FloatArray) -> ResponseComparison:
    frf = problem.frf
    deviation = np.sqrt(frf.variance()) if frf.has_covariance else np.full(frf.response.shape, np.nan)
    between = ResponseComparison.frequencies_of_curves(frf.frequency_hz)
    return ResponseComparison(
        axis_names=frf.axis_names,
        frequency_hz=frf.frequency_hz,
        measured=frf.response,
        modelled=problem.model(point),
        start=problem.model(problem.start),
        deviation=deviation,
        curve_frequency_hz=between,
        curve=problem.between_lines(point, between),
        curve_start=problem.between_lines(problem.start, between),
    )


def _usable_lines(frf: Frf) -> BoolArray:
    """Lines that are valid and finite, shape (n_config, n_freq); DataRejected where a configuration has none."""
    if frf.response.shape[2] != frf.response.shape[3]:
        raise DataRejected(
            "the response matrix is not square: one torque and one motor angle per axis are needed"
        )
    used = frf.valid_lines & np.isfinite(frf.response).all(axis=(2, 3))
    empty = np.flatnonzero(~used.any(axis=1))
    if len(empty):
        raise DataRejected(
            f"configuration {int(empty[0]) + 1} has no valid line left; look at the record before fitting"
        )
    return used
