"""Springs, dampers, friction and inertia from the torque that the measured motion takes, in all bins of its spectrum.

No response is estimated, so nothing nonlinear is averaged: friction is a free function of the measured speed, moving
arm and nonlinear springs are simulated under the measured motion of the motors. Bodies are free within what a drawing
promises. Passes: the linear model first; then {prescribed motion of the present model, Gauss-Newton steps}, until what
a pass changes is small against what is stated. Weights are differences between periods and one relative model error.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    ConfigurationError,
    Context,
    DataRejected,
    Estimator,
    Fit,
    FreeParameters,
    ParameterTable,
    Record,
    Robot,
    chosen_names,
)
from robid_core.estimation.intervals import covariance_with_model_error, jackknife_shifts
from robid_core.estimation.least_squares import levenberg_marquardt
from robid_core.estimation.torque.spectra import PeriodicMotion, periodic_motion_of
from robid_core.estimation.torque.weights import HALF_WINDOW, covariance_of, whitener
from robid_core.mechanics import SimulationState
from robid_fit.torque_model import model_of
from robid_fit.torque_problem import EffectColumn, Linearisation, TorqueProblem
from robid_fit.torque_remainder import impedance, remainder

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

REPLACED = ("coulomb", "offset", "speed")  # of the motors' friction, by free functions of speed
UNSEEN = ("controller", "sensor", "drive")
EVERY = 5  # of the bins that are no lines, in the first pass
FIRST_LINEARISATIONS = 5  # of the linear model, each with new weights
STEPS = 6  # of Gauss-Newton with the derivatives of one point
SMALL_GAIN = 1e-6  # of the cost: steps that gain less end
ENOUGH = 0.2  # of the stated error: a pass that changes the springs by less is the last
DIFFERENCE = 1e-3  # step of derivatives by two prescribed motions, in natural scales
NUMERICAL = 1.2e-4  # of a parameter: what steps of integration and band limits leave, alike in all poses
WEAK = 0.5  # posterior over prior: above it the data hardly see a parameter


def default_patterns(robot: Robot) -> tuple[str, ...]:
    """Springs, dampers, viscous friction and inertia, as far as the robot has them."""
    heads = {name.partition(".")[0] for name in robot.layout}
    nouns = ("gear_stiffness", "gear_damping", "bearing_stiffness", "bearing_damping", "rotor_inertia")
    found = [noun for noun in (*nouns, "mass", "centre_of_mass", "inertia") if noun in heads]
    return ("friction.*.viscous", *(f"{noun}.*" for noun in found))


class TorqueResidualFit(Estimator):
    """Fit a robot to the torque that its measured motion takes, in all bins up to a limit.

    Example::

        fit: {use: fit.torque_residual, with: {free: [gear_*, bearing_*, friction.*.viscous, mass.*, inertia.*]}}
    """

    free: tuple[str, ...] | None = None
    """Patterns of the parameters that are estimated, effects by `effect.<label>.*`; null: springs, dampers, viscous
    friction, and the inertia of bodies and rotors."""
    fixed: tuple[str, ...] = ()
    """Patterns of parameters that are held all the same."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations by pattern, in natural scales (0.01: one percent); wide for springs, 0.01 for bodies."""
    highest_hz: PositiveFloat = 100.0
    """Bins above are left out."""
    friction_widths: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (0.15, 0.5, 1.5, 5.0, 15.0)
    """Speeds of the free friction functions tanh(v / w), rad/s at the motor."""
    model_error: PositiveFloat = 2e-4
    """Relative error of the model's torque per bin and axis, beside the noise."""
    passes: PositiveInt = 8
    """Prescribed motions at most."""
    discard: NonNegativeInt = 0
    """Leading periods dropped as transient."""

    def run(self, record: Record, robot: Robot, context: Context) -> Fit:
        """Estimate the free parameters of the robot."""
        motion = self._motion(record)
        problem = self._problem(robot, motion)
        point = self._first_pass(problem, context)
        state: SimulationState | None = None
        changes: list[float] = []
        for number in range(self.passes):
            context.progress(number + 1, self.passes + 1, "torque of the measured motion")
            state = self._renew(problem, point, state)
            weight = self._weight(problem, point)
            about = problem.linearise(point, weight)
            before, point = point, self._minimise(problem, point, weight, about)
            covariance = self._covariance(problem, point, about)
            moved = np.abs(point - before) / np.sqrt(np.diag(covariance))
            changes.append(float(moved[self._springs(problem)].max(initial=0.0)))
            if changes[-1] < ENOUGH:
                break
        context.progress(self.passes + 1, self.passes + 1, "")
        covariance = covariance + np.outer(point - before, point - before)
        found = self._result(problem, point, covariance, changes)
        return found.replace(
            model=model_of(robot, motion, self.friction_widths, problem.free, point, covariance)
        )

    # Data and unknowns

    def _motion(self, record: Record) -> PeriodicMotion:
        run = record.run
        if record.line is None:
            raise DataRejected("the record is not periodic; fit.torque_residual needs whole periods")
        if record.torque_hold != "zero_order_hold":
            raise DataRejected(
                f"the torque is said to be {record.torque_hold}; fit.torque_residual needs a held one"
            )
        if run.n_period - self.discard < 2:
            raise DataRejected(
                f"{run.n_period - self.discard} period is left; two are needed to tell the noise: measure "
                "more periods (acquisition: periods)"
            )
        position, torque = (
            run.values(name)[:, :, :, self.discard :] for name in ("motor_position", "motor_torque")
        )
        if not run.valid[:, :, :, self.discard :].all():
            raise DataRejected("a sample is missing in a period that is kept; drop its period")
        return periodic_motion_of(position, torque, run.sample_time_s, record.line, self.highest_hz)

    def _problem(self, robot: Robot, motion: PeriodicMotion) -> TorqueProblem:
        patterns = default_patterns(robot) if self.free is None else self.free
        names = chosen_names(list(robot.layout), patterns, self.fixed)
        for name in names:
            if robot.parameter_kind(name) in UNSEEN:
                raise ConfigurationError(f"free '{name}': the torque residual does not depend on it; hold it")
            if name.startswith("friction.") and name.endswith(REPLACED):
                raise ConfigurationError(
                    f"free '{name}': free functions of speed stand in its place; free friction.*.viscous alone"
                )
        levels = {
            n: 0.0 for n in robot.layout if n.startswith("friction.") and n.endswith((".coulomb", ".offset"))
        }
        free = FreeParameters.of_robot(robot.with_parameters(levels), names, self.prior)
        used = np.ones(len(motion.frequency_hz), dtype=np.bool_)
        return TorqueProblem(free, motion, self.friction_widths, used)

    # Passes

    def _first_pass(self, problem: TorqueProblem, context: Context) -> FloatArray:
        """Fit the linear model on the lines and some other bins, weighted by what it leaves; bodies are held.

        What it leaves out is a percent of the torque and smooth: bodies would bend to it, and so would the mean torque.
        """
        context.progress(0, self.passes + 1, "linear model")
        motion, point = problem.motion, np.zeros(problem.n_unknown)
        problem.used = motion.excited | (np.arange(len(motion.excited)) % EVERY == 0)
        problem.used[0], problem.bodies_held = False, True
        size = covariance_of(motion.torque_spectrum)
        weight = whitener(0.01 * size * np.eye(size.shape[-1]))
        for _ in range(FIRST_LINEARISATIONS):
            point = self._minimise(problem, point, weight, problem.linearise(point, weight))
            weight = whitener(covariance_of(problem.residual(point)))
        problem.used, problem.bodies_held = np.ones_like(problem.used), False
        return point

    def _weight(self, problem: TorqueProblem, point: FloatArray) -> ComplexArray:
        """Whitener of noise and model error."""
        torque = problem.motion.torque_spectrum
        size = covariance_of(torque)
        mean = np.abs(torque[:, :, 0]) ** 2
        size[0] = mean.mean(axis=(0, 1))  # the mean is no neighbour of the lowest bins
        return whitener(problem.noise(point) + self.model_error**2 * size * np.eye(size.shape[-1]))

    def _renew(
        self, problem: TorqueProblem, point: FloatArray, state: SimulationState | None
    ) -> SimulationState:
        """Prescribe the measured motion to the present model, and differentiate what only that knows.

        With nonlinear springs it knows the linear ones, too: what they do depends on how far the others are bent.
        """
        free, motion, angle = problem.free, problem.motion, problem.angle
        coordinates = point[: problem.n_free]
        robot = free.robot_at(coordinates)
        problem.remainder, state = remainder(robot, angle, motion, state)
        here = impedance(robot, angle, motion, "zero_order_hold")
        columns = []
        for i, name in enumerate(free.names):
            kind = robot.parameter_kind(name)
            elastic = kind in ("stiffness", "damping")
            if kind in ("inertia", "friction") or (elastic and not robot.bending_forces):
                continue  # the linear columns are enough
            moved = coordinates.copy()
            moved[i] += DIFFERENCE
            other = free.robot_at(moved)
            left, _ = remainder(other, angle, motion, state)
            change = impedance(other, angle, motion, "zero_order_hold") - here
            linear = np.einsum("cfab,cxfb->cxfa", change, motion.acceleration_spectrum) / DIFFERENCE
            columns.append(EffectColumn(i, point[i], (left - problem.remainder) / DIFFERENCE, linear))
        problem.effects = tuple(columns)
        return state

    @staticmethod
    def _minimise(
        problem: TorqueProblem, point: FloatArray, weight: ComplexArray, about: Linearisation
    ) -> FloatArray:
        """Take damped Gauss-Newton steps with the derivatives of one point."""
        precision = 1 / problem.prior**2
        whole = about.matrices.sum(axis=0) + np.diag(precision)

        def equations(at: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            slope = precision * at - problem.gradients(at, about).sum(axis=0)
            return 0.5 * problem.cost(at, weight), slope, whole

        open_end = np.full(problem.n_unknown - problem.n_free, np.inf)
        return levenberg_marquardt(
            equations,
            lambda at: 0.5 * problem.cost(at, weight),
            point,
            np.concatenate((problem.free.lower, -open_end)),
            np.concatenate((problem.free.upper, open_end)),
            STEPS,
            SMALL_GAIN,
        ).point

    # What is stated

    @staticmethod
    def _covariance(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> FloatArray:
        """Of all unknowns: formal, widened by what leaving out a configuration moves."""
        whole = about.matrices.sum(axis=0) + np.diag(1 / problem.prior**2)
        formal: FloatArray = np.linalg.inv(whole)
        if len(about.matrices) < 2:
            covariance = formal
        else:
            shifts = jackknife_shifts(whole, problem.gradients(point, about), about.matrices)
            covariance = covariance_with_model_error(formal, shifts)
        floor = np.zeros(len(formal))
        floor[: problem.n_free] = NUMERICAL**2
        return covariance + np.diag(floor)

    @staticmethod
    def _springs(problem: TorqueProblem) -> npt.NDArray[np.int64]:
        kinds = [problem.free.robot.parameter_kind(name) for name in problem.free.names]
        return np.flatnonzero(np.array([kind in ("stiffness", "effect") for kind in kinds]))

    @staticmethod
    def misfit(problem: TorqueProblem, point: FloatArray) -> float:
        """Weighted residual per degree of freedom against the noise alone, corrected for few periods."""
        motion = problem.motion
        n_config, n_exp, n_period, _, n_axis = motion.torque_deviation.shape
        white = np.einsum("fab,cxfb->cxfa", whitener(problem.noise(point)), problem.residual(point))[:, :, 1:]
        freedom = n_config * n_exp * (n_period - 1) * (2 * HALF_WINDOW + 1)
        return float((np.abs(white) ** 2).mean() * (freedom - n_axis) / freedom)

    def _result(
        self, problem: TorqueProblem, point: FloatArray, covariance: FloatArray, changes: list[float]
    ) -> Fit:
        free, n = problem.free, problem.n_free
        slope = np.eye(len(point))
        slope[:n, :n] = free.jacobian(point[:n])
        error = np.sqrt(np.diag(slope @ covariance @ slope.T))
        values = free.values(point[:n])
        nuisances = problem.nuisance_names()
        robot = free.robot
        kinds = tuple(robot.parameter_kind(name) for name in free.names)
        stiff = np.array([kind in ("stiffness", "effect") for kind in kinds] + [False] * len(nuisances))
        at_bound = np.concatenate(
            (np.abs(point[:n]) >= free.upper * (1 - 1e-9), np.zeros(len(nuisances), dtype=bool))
        )
        units = ["N m"] * (len(nuisances) - 1) + ["s"]
        table = ParameterTable(
            names=free.names + nuisances,
            units=tuple(robot.parameter_unit(name) for name in free.names) + tuple(units),
            groups=kinds + ("nuisance",) * len(nuisances),
            start=np.concatenate((free.start, np.zeros(len(nuisances)))),
            estimate=np.concatenate((list(values.values()), point[n:])),
            standard_error=error,
            reported=stiff,
            at_bound=at_bound,
        )
        misfit = self.misfit(problem, point)
        converged = changes[-1] < ENOUGH
        status = "converged" if converged else f"{self.passes} passes were not enough"
        status += (
            f"; the last of {len(changes)} passes moved the springs by {changes[-1]:.2g} standard errors"
        )
        if len(changes) > 1 and changes[-2] > 0:
            status += f" ({changes[-1] / changes[-2]:.2g} of the one before)"
        weak = np.sqrt(np.diag(covariance))[:n] > WEAK * free.prior
        weak &= np.array([kind == "stiffness" for kind in kinds])
        if weak.any():
            status += f"; hardly seen: {', '.join(np.array(free.names)[weak])}"
        status += f"; torque lags by {1e6 * point[-1]:.3g} us"
        return Fit(
            method="torque residual in all bins, friction as free functions of speed",
            status=status,
            converged=converged,
            misfit=misfit,
            n_starts=1,
            n_agree=1,
            parameters=table,
            covariance=covariance,
            free_names=free.names + nuisances,
        )
