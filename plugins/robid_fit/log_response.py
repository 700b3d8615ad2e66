"""Stiffness and damping from measured frequency responses: the thesis' fit (3.1)-(3.2), with honest weights.

The weight is the inverse of (covariance of the measured response + error of the model). The size of the
model's error is estimated from the data: the smallest one with which the residual is what it should be, one per
degree of freedom. Several starts around the nominal robot; standard errors from a jackknife over
configurations (see estimation.intervals), because what a linear model leaves out is common to a configuration
and smooth over lines.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from robid_core import (
    Context,
    DataRejected,
    Estimator,
    Fit,
    Frf,
    NotIdentifiable,
    ParameterTable,
    ResponseComparison,
    Robot,
)
from robid_core.estimation.information import covariance_of_parameters
from robid_core.estimation.intervals import covariance_with_model_error, jackknife_shifts
from robid_core.estimation.least_squares import Minimum, levenberg_marquardt
from robid_fit.problem import LogResponseProblem, Unknowns, log_covariance

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

# Entries noisier than this carry a biased logarithm (E1(SNR)/2: 0.2 % at 6 dB, 11 % at 0 dB).
LOWEST_SIGNAL_TO_NOISE = 4.0
# Starts stop when a thousandth of the cost is left to gain: enough to tell basins apart; the best is refined.
COARSE_TOLERANCE = 1e-3
# A parameter with a larger relative standard error was not seen.
LARGEST_RELATIVE_ERROR = 1.0


class LogResponseFit(Estimator):
    """Fit springs and dampers to the logarithm of a measured response matrix (thesis 3.1, 3.2).

    Example::

        fit: {use: fit.log_response, with: {starts: 20}}
    """

    starts: Annotated[int, Field(ge=1, le=10_000)] = 20
    """Start points: the nominal robot and random ones around it."""
    start_spread: PositiveFloat = 0.35
    """Standard deviation of the starts' logarithms around the nominal values."""
    largest_change: Annotated[float, Field(gt=1)] = 20.0
    """Bounds: a parameter may differ from its nominal value by this factor."""
    model_error: NonNegativeFloat | None = None
    """Relative error of the model per entry; null: estimated from the data."""
    coupling_share: NonNegativeFloat = 0.1
    """Share of the diagonal's size below which an entry's model error does not fall."""
    max_iterations: PositiveInt = 60
    """Accepted steps of one start at most."""

    def run(self, frf: Frf, robot: Robot, context: Context) -> Fit:
        """Estimate all springs and dampers of the robot."""
        used = _usable_lines(frf)
        start = np.log(Unknowns.of_robot(robot).start)
        level = 0.05 if self.model_error is None else self.model_error
        coarse = frf.select("n_freq", slice(None, None, 3))
        problem = self._problem(robot, coarse, _usable_lines(coarse), level)
        points = self._start_points(start, context.generator)
        ends = [
            self._minimise(problem, point, start, COARSE_TOLERANCE)
            for point in context.track(points, len(points), "starts")
        ]
        best = min(ends, key=lambda end: end.cost)
        agree = sum(end.cost < best.cost * 1.05 + 1e-9 for end in ends)
        best, level, problem = self._refine(robot, frf, used, best, start, level)
        return self._result(problem, best, start, len(points), agree, level)

    def _problem(
        self, robot: Robot, frf: Frf, used: npt.NDArray[np.bool_], level: float
    ) -> LogResponseProblem:
        return LogResponseProblem(robot, frf, self._weights(frf, used, level), used)

    def _weights(self, frf: Frf, used: npt.NDArray[np.bool_], level: float) -> ComplexArray:
        """Covariance of log vec(G) on every used line, entries lost in noise taken out."""
        n_config, n_freq, n_axis, _ = frf.response.shape
        n_entry = n_axis * n_axis
        result = np.zeros((n_config, n_freq, n_entry, n_entry), dtype=complex)
        index = np.arange(n_entry)
        for c in range(n_config):
            lines = used[c]
            measured = frf.response[c, lines]
            noise = (
                frf.covariance(c)[lines]
                if frf.has_covariance
                else np.zeros((lines.sum(), n_entry, n_entry), complex)
            )
            weights = log_covariance(measured, noise, max(level, 1e-4), self.coupling_share)
            lost = np.einsum("fee->fe", weights).real > 1 / LOWEST_SIGNAL_TO_NOISE
            weights[:, index, index] += np.where(lost, 1e6, 0.0)
            result[c, lines] = weights
        return result

    def _start_points(self, start: FloatArray, generator: np.random.Generator) -> list[FloatArray]:
        spread = self.start_spread * generator.standard_normal((self.starts - 1, len(start)))
        return [start, *(start + row for row in spread)]

    def _minimise(
        self, problem: LogResponseProblem, point: FloatArray, start: FloatArray, tolerance: float = 1e-9
    ) -> Minimum:
        reach = np.log(self.largest_change)
        return levenberg_marquardt(
            problem.equations,
            problem.cost,
            point,
            start - reach,
            start + reach,
            self.max_iterations,
            tolerance,
        )

    def _refine(
        self,
        robot: Robot,
        frf: Frf,
        used: npt.NDArray[np.bool_],
        best: Minimum,
        start: FloatArray,
        level: float,
    ) -> tuple[Minimum, float, LogResponseProblem]:
        """Refit on all lines, the model's error adjusted until the misfit is one per degree of freedom."""
        problem = self._problem(robot, frf, used, level)
        best = self._minimise(problem, best.point, start)
        if self.model_error is not None:
            return best, level, problem
        for _ in range(3):
            level = self._level_for(robot, frf, used, problem.model(best.point))
            problem = self._problem(robot, frf, used, level)
            best = self._minimise(problem, best.point, start)
        return best, level, problem

    def _level_for(self, robot: Robot, frf: Frf, used: npt.NDArray[np.bool_], model: ComplexArray) -> float:
        """Model error with which the standardised residual is one per degree of freedom, by bisection."""
        low, high = 1e-3, 0.5
        freedom = used.sum() * frf.response.shape[2] ** 2
        for _ in range(9):
            middle = float(np.sqrt(low * high))
            residual = self._problem(robot, frf, used, middle).whitened(model)
            misfit = (np.abs(residual) ** 2).sum() / freedom
            low, high = (middle, high) if misfit > 1 else (low, middle)
        return float(np.sqrt(low * high))

    def _result(
        self,
        problem: LogResponseProblem,
        best: Minimum,
        start: FloatArray,
        n_starts: int,
        agree: int,
        level: float,
    ) -> Fit:
        unknowns, frf = problem.unknowns, problem.frf
        cost, gradients, matrices = problem.by_configuration(best.point)
        freedom = 2 * problem.used.sum() * frf.response.shape[2] ** 2 - len(start)
        estimate = np.exp(best.point)
        status = f"{best.message}; model error {100 * level:.2g} % per entry"
        try:
            covariance = covariance_of_parameters(matrices.sum(axis=0), unknowns.names)
            if len(gradients) >= 2:
                shifts = jackknife_shifts(matrices.sum(axis=0), gradients, matrices)
                covariance = covariance_with_model_error(covariance, shifts)
            error = np.sqrt(np.diag(covariance))
        except NotIdentifiable as blind:
            covariance, error = np.full((len(start), len(start)), np.nan), np.full(len(start), np.nan)
            status += f"; {blind}"
        unseen = ~(error < LARGEST_RELATIVE_ERROR)
        stiff = np.array([group == "stiffness" for group in unknowns.groups])
        if (unseen & stiff).any() and "see" not in status:
            names = ", ".join(n for n, u in zip(unknowns.names, unseen & stiff, strict=True) if u)
            status += f"; not identifiable from these configurations: {names}"
        against = "" if self.model_error is None else f"covariance and a model error of {100 * level:.2g} %"
        reach = np.log(self.largest_change)
        own = unknowns.names[: 2 * unknowns.n_spring]  # the others are nuisances
        scale = estimate[: len(own)]
        model = problem.robot.model(
            dict(zip(own, scale.tolist(), strict=True)),
            own,
            covariance[: len(own), : len(own)] * np.outer(scale, scale),
        )
        table = ParameterTable(
            names=unknowns.names,
            units=unknowns.units,
            groups=unknowns.groups,
            start=unknowns.start,
            estimate=estimate,
            standard_error=np.where(unseen, np.nan, error * estimate),
            reported=stiff,
            at_bound=np.abs(best.point - start) >= reach * (1 - 1e-9),
        )
        return Fit(
            method="log response, weights from covariance and model error",
            status=status,
            converged=best.converged,
            misfit=2 * cost / float(freedom),
            n_starts=n_starts,
            n_agree=agree,
            parameters=table,
            covariance=covariance,
            free_names=unknowns.names,
            response=_comparison(problem, best.point, start),
            misfit_against=against,
            model_error=level,
            model=model,
        )


def _comparison(problem: LogResponseProblem, point: FloatArray, start: FloatArray) -> ResponseComparison:
    frf = problem.frf
    deviation = np.sqrt(frf.variance()) if frf.has_covariance else np.full(frf.response.shape, np.nan)
    return ResponseComparison(
        axis_names=frf.axis_names,
        frequency_hz=frf.frequency_hz,
        measured=frf.response,
        modelled=problem.model(point),
        start=problem.model(start),
        deviation=deviation,
    )


def _usable_lines(frf: Frf) -> npt.NDArray[np.bool_]:
    """Lines that are valid and finite, shape (n_config, n_freq); DataRejected where a configuration has none."""
    if frf.response.shape[2] != frf.response.shape[3]:
        raise DataRejected(
            "the response matrix is not square: one torque and one motor angle per axis are needed"
        )
    used = frf.valid_lines & np.isfinite(frf.response).all(axis=(2, 3))
    empty = np.flatnonzero(~used.any(axis=1))
    if len(empty):
        raise DataRejected(
            f"configuration {int(empty[0])} has no valid line left; look at the record before fitting"
        )
    return used
