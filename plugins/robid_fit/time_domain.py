"""Any number of the robot file from the motion that its closed loop makes of the recorded references: output error.

The robot is simulated as every other stage simulates it, with its controllers, effects and friction, and the free
parameters move until its outputs are the recorded ones (Levenberg-Marquardt). Nothing is differentiated or filtered,
and no torque needs to be recorded: a servo that tells its position only is enough. Over a horizon the simulation begins
anew from the measured state (multi-step prediction): errors that only build up with time count less, and motions on
which a whole run would part from the recording stay usable. Sources: R. V. Jategaonkar, Flight Vehicle System
Identification, 2015, ch. 4 (output error); L. Ljung, System Identification, 1999, sections 3.2 (k-step prediction)
and 9.3 (correlated residuals). Standard errors are those of residuals that are correlated in time
(`estimation.serial_correlation`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from robid_core import (
    ConfigurationError,
    Context,
    DataRejected,
    Doubt,
    Estimator,
    Fit,
    FloatArray,
    FreeParameters,
    IntArray,
    ParameterTable,
    Record,
    Robot,
    RobotName,
    TimeComparison,
    chosen_names,
    pattern_problems,
    simulate_record,
)
from robid_core.estimation.disagreement import (
    ExperimentShare,
    disagreement,
    spread_over_experiments,
)
from robid_core.estimation.least_squares import Minimum, levenberg_marquardt
from robid_core.estimation.serial_correlation import n_cosine, sandwich_covariance
from robid_core.residual import (
    check_variants,
    default_patterns,
    excited_range,
    parts_by_variant,
    variant_robots,
)
from robid_fit.disagreement_doubt import disagreement_doubt
from robid_fit.output_error import (
    OutputErrorProblem,
    Part,
    Prediction,
    compared,
    information_share,
)
from robid_fit.torque_gain import common_scale_problem

Output = Literal["motor_position", "motor_speed", "motor_torque"]

SETTLED = 0.1  # of what a residual counts beside priors: renewed until it changes by less
RENEWALS = 5
TOLERANCE = 1e-9  # of the cost
LEFT = 0.05  # of the log-likelihood, that a further step promises: 0.3 standard errors at most


def _why_not_free(robot: Robot, name: str) -> str:
    """Say why this fit cannot free a parameter; empty where it can."""
    if robot.parameter_kind(name) == "sensor":
        return "a simulation without noise does not depend on it; hold it"
    return ""


def without_encoder_steps(robot: Robot) -> Robot:
    """Return a robot that measures angles exactly: steps of an encoder have no derivative."""
    axes = {
        name: axis.model_copy(update={"sensors": axis.sensors.model_copy(update={"encoder_counts": 0.0})})
        for name, axis in robot.description.axes.items()
    }
    return replace(robot, description=robot.description.model_copy(update={"axes": axes}))


@dataclass(frozen=True, eq=False)
class Estimate:
    """Where the fit ended, with the covariance of its coordinates (n_free, n_free)."""

    minimum: Minimum
    covariance: FloatArray
    mean_square: float
    """Of the residuals."""
    iterations: int


def minimise(
    problem: OutputErrorProblem, iterations: int, progress: Callable[[float, float, str], None]
) -> Estimate:
    """Minimise the output error, and weigh residuals against priors by what they turn out to tell."""
    point, count, done = np.zeros(len(problem.free.names)), 0, 0

    def equations(there: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        nonlocal done
        progress(min(done, iterations - 1), iterations, "simulating the closed loop")
        done += 1
        return problem.equations(there)

    for renewal in range(RENEWALS):
        mean_square, matrix, long_run = problem.information(point)
        before, problem.share = problem.share, information_share(mean_square, matrix, long_run)
        if renewal and abs(problem.share / before - 1) < SETTLED:
            break
        minimum = levenberg_marquardt(
            equations,
            problem.cost,
            point,
            problem.free.lower,
            problem.free.upper,
            iterations,
            TOLERANCE,
        )
        point, count = minimum.point, count + minimum.iterations
    if not minimum.converged and _left(problem, point) < LEFT:
        minimum = replace(minimum, converged=True, message="converged within 0.3 standard errors")
    mean_square, matrix, long_run = problem.information(point)
    prior = np.diag(1 / problem.free.prior**2)
    covariance = sandwich_covariance(problem.share * matrix + prior, problem.share**2 * long_run + prior)
    return Estimate(minimum, covariance, mean_square, count)


def _left(problem: OutputErrorProblem, point: FloatArray) -> float:
    """How much of the log-likelihood a whole step promises, bounds that are met held."""
    _, gradient, matrix = problem.equations(point)
    lower, upper = problem.free.lower, problem.free.upper
    inside = ~(((point <= lower) & (gradient > 0)) | ((point >= upper) & (gradient < 0)))
    slope = gradient[inside]
    return 0.5 * float(slope @ np.linalg.solve(matrix[np.ix_(inside, inside)], slope))


class TimeDomainFit(Estimator):
    """Fits a robot to recorded outputs by simulating its closed loop under the recorded references.

    Example::

        fit:
          use: fit.time_domain
          with: {free: [mass.*, friction.*.coulomb, friction.*.viscous], outputs: [motor_position], horizon_s: 0.5}
    """

    free: tuple[str, ...] | None = None
    """Patterns of the parameters that are estimated, effects by `effect.<label>.*`; null: springs, dampers, viscous
    friction, and the inertia of bodies and rotors."""
    fixed: tuple[str, ...] = ()
    """Patterns of parameters that are held all the same."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations by pattern, in natural scales (0.01: one percent); wide for springs, 0.01 for bodies."""
    outputs: Annotated[tuple[Output, ...], Field(min_length=1)] = ("motor_position", "motor_torque")
    """Channels that simulation and recording are compared in."""
    weights: Literal["rms", "noise"] = "rms"
    """Residuals over the rms of what was measured, by channel and axis; or over what the noise of the robot file's
    sensors makes of each channel in closed loop."""
    horizon_s: PositiveFloat | None = None
    """The simulation begins anew from the measured state that often; null: each experiment is one simulation."""
    half_window: PositiveInt = 5
    """Samples on either side from which that state is estimated."""
    start: Literal["rest", "motion"] = "rest"
    """How each experiment begins where there is no horizon: at rest, or under way."""
    skip_s: NonNegativeFloat = 0.0
    """Time at the start of each experiment that is simulated and not compared."""
    iterations: PositiveInt = 60
    """Steps at most, each time that the weight of the residuals beside priors is renewed."""
    step: Annotated[float, Field(gt=0, le=0.1)] = 1e-3
    """Half the width of differences, in natural scales; 0.02 where friction sticks and outputs jump with numbers."""
    robots: dict[str, RobotName] = {}
    """Robots under which variants of a record were measured, where they are not the nominal one; all share the free
    parameters."""

    constants: dict[str, str] = {}
    """Constants of the records that are parameters of the robot, `{payload_kg: effect.load.mass}`: each variant's robot
    has the value of its experiments, and needs no file under `robots`."""

    handles_variants: ClassVar[bool] = True

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Patterns that mean nothing in this robot, and parameters that this fit cannot free."""
        patterns = default_patterns(robot) if self.free is None else self.free
        found = pattern_problems(
            robot, patterns, self.fixed, self.prior, lambda name: _why_not_free(robot, name)
        )
        return found or common_scale_problem(robot, chosen_names(list(robot.layout), patterns, self.fixed))

    def run(self, record: tuple[Record, ...], robot: Robot, context: Context) -> Fit:
        """Estimate the free parameters of the robot from one record or several together."""
        problem = self.problem(record, robot, context.generator)
        estimate = minimise(problem, self.iterations, context.progress)
        context.progress(self.iterations, self.iterations)
        told, _ = variant_robots(record, robot, self.robots, self.constants)
        found = self._result(problem, estimate, told)
        return found.replace(excited=excited_range([part.record for part in problem.parts]))

    # Data and unknowns

    def problem(
        self, record: tuple[Record, ...], robot: Robot, generator: np.random.Generator
    ) -> OutputErrorProblem:
        """Return what is minimised; `generator` draws the noise that weights are told by."""
        for place, message in self.problems_with(robot).items():
            raise ConfigurationError(f"{place[0]}: {message}")
        patterns = default_patterns(robot) if self.free is None else self.free
        names = chosen_names(list(robot.layout), patterns, self.fixed)
        robot, others = variant_robots(record, robot, self.robots, self.constants)
        check_variants(record, robot, others, names)
        training = [one.training() for one in record]
        for run in (run for one in training for run in one.runs):
            for name in self.outputs:
                run.channel(name)
        nominal = without_encoder_steps(robot)
        smooth = {variant: without_encoder_steps(other) for variant, other in others.items()}
        measured = [
            Part(part, smooth.get(variant, nominal))
            for one in training
            for variant, part in parts_by_variant(one)
        ]
        free = FreeParameters.of_robot(nominal, names, dict(self.prior))
        scale = self._scale(measured, generator)
        prediction = Prediction(self.start, self.horizon_s, self.half_window, self.skip_s, self.step)
        return OutputErrorProblem(free, measured, self.outputs, scale, prediction)

    def _scale(self, parts: list[Part], generator: np.random.Generator) -> FloatArray:
        """What residuals are divided by, (n_output n_axis,)."""
        rows: list[FloatArray] = []
        for part in parts:
            runs = [part.record]
            if self.weights == "noise":
                seed = int(generator.integers(2**31))
                runs = [
                    simulate_record(part.robot, part.record, self.start, seed=one) for one in (seed, None)
                ]
            channels = [compared(one, self.outputs, self.skip_s) for one in runs]
            for values in zip(*channels, strict=True):
                about = values[0] - (values[1] if len(values) > 1 else values[0].mean(axis=1, keepdims=True))
                rows.append(about.reshape(-1, about.shape[2]))
        rms: FloatArray = np.sqrt((np.concatenate(rows) ** 2).mean(axis=0))
        if self.weights == "noise" and not rms.all():
            raise ConfigurationError(
                "weights: noise: the robot file states no noise that reaches every output; give axes.*.sensors "
                "position_noise and torque_noise, or take weights: rms"
            )
        if not rms.any():
            raise DataRejected("nothing moves in the outputs of the record; take another record")
        return np.where(rms > 0, rms, np.inf)

    # What is stated

    def _result(self, problem: OutputErrorProblem, estimate: Estimate, robot: Robot) -> Fit:
        free, minimum = problem.free, estimate.minimum
        slope = free.jacobian(minimum.point)
        covariance = slope @ estimate.covariance @ slope.T
        values = free.values(minimum.point)
        kinds = tuple(robot.parameter_kind(name) for name in free.names)
        inside, shares, hessian = self._shares(problem, estimate)
        spread = spread_over_experiments(shares, hessian, slope[:, inside])
        table = ParameterTable(
            names=free.names,
            units=tuple(robot.parameter_unit(name) for name in free.names),
            groups=kinds,
            start=free.start,
            estimate=np.array(list(values.values())),
            standard_error=np.sqrt(np.diag(covariance)),
            reported=np.ones(len(kinds), dtype=bool),
            at_bound=(minimum.point >= free.upper - 1e-9) | (minimum.point <= free.lower + 1e-9),
            prior=np.sqrt(((slope * free.prior) ** 2).sum(axis=1)),
            spread=np.where((slope[:, inside] != 0).any(axis=1), spread, np.nan),
        )
        time = self._comparisons(problem, minimum.point)
        errors = ", ".join(
            f"{one.channel.replace('_', ' ')} {100 * one.relative_error:.3g} %" for one in time
        )
        kind = (
            "whole runs"
            if self.horizon_s is None
            else f"predictions over {self.horizon_s:g} s from the measured state"
        )
        noise = self.weights == "noise"
        return Fit(
            method=f"output error in closed loop, {kind}",
            status=f"{minimum.message} after {estimate.iterations} iterations; relative errors: {errors}",
            converged=minimum.converged,
            misfit=estimate.mean_square if noise else 1.0,
            misfit_against="what the sensors' noise makes of the outputs" if noise else "",
            n_starts=1,
            n_agree=1,
            parameters=table,
            covariance=estimate.covariance,
            free_names=free.names,
            time=time,
            model=robot.model(values, free.names, covariance),
            stated_doubts=tuple(self._apart(problem, estimate, inside, shares, hessian)),
        )

    def _shares(
        self, problem: OutputErrorProblem, estimate: Estimate
    ) -> tuple[IntArray, list[ExperimentShare], FloatArray]:
        """Unknowns that are at no bound, what each experiment says of them, and the Hessian of half the cost."""
        free, point = problem.free, estimate.minimum.point
        inside = np.flatnonzero((point < free.upper - 1e-9) & (point > free.lower + 1e-9))
        among = np.ix_(inside, inside)
        shares = [
            ExperimentShare(one.information[among], one.gradient[inside], one.scores[among])
            for one in problem.by_experiment(point)
        ]
        hessian = np.diag(1 / free.prior[inside] ** 2) + np.sum([one.information for one in shares], axis=0)
        return inside, shares, hessian

    def _apart(
        self,
        problem: OutputErrorProblem,
        estimate: Estimate,
        inside: IntArray,
        shares: list[ExperimentShare],
        hessian: FloatArray,
    ) -> Iterator[Doubt]:
        """Doubt parameters that experiments disagree on, those at a bound left aside."""
        free, point = problem.free, estimate.minimum.point
        if len(shares) < 2 or not len(inside) or not estimate.minimum.converged:
            return
        freedom = sum(n_cosine(len(lane)) for residual in problem.residuals(point) for lane in residual)
        among = np.ix_(inside, inside)
        found = disagreement(shares, hessian, estimate.covariance[among], np.eye(len(inside)), float(freedom))
        yield from disagreement_doubt(found, [free.names[i] for i in inside.tolist()], len(shares))

    def _comparisons(self, problem: OutputErrorProblem, point: FloatArray) -> tuple[TimeComparison, ...]:
        """Measured and simulated outputs, the experiments of all parts laid end to end."""
        found, n_axis = [], problem.free.robot.n_axis
        records = [part.record for part in problem.parts]
        sides = []
        for record, made in zip(records, problem.simulated(point), strict=True):
            sides.append([compared(one, self.outputs, self.skip_s) for one in (record, made)])
        measured, modelled = (
            np.concatenate([lanes.reshape(-1, lanes.shape[2]) for side in sides for lanes in side[which]])
            for which in (0, 1)
        )
        sample_time = records[0].runs[0].sample_time_s
        for k, name in enumerate(self.outputs):
            own = slice(k * n_axis, (k + 1) * n_axis)
            theirs, ours = measured[:, own], modelled[:, own]
            found.append(
                TimeComparison(
                    axis_names=records[0].axis_names,
                    channel=name,
                    unit_symbol=records[0].runs[0].channel(name).unit_symbol,
                    relative_error=float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)),
                    time_s=np.arange(len(theirs), dtype=np.float64) * sample_time,
                    measured=theirs,
                    modelled=ours,
                )
            )
        return tuple(found)
