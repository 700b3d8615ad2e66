"""Springs, dampers, friction and inertia from the torque that the measured motion takes, in all bins of its spectrum.

No response is estimated, so nothing nonlinear is averaged: friction is a free function of the measured speed, moving
arm and nonlinear springs are simulated under the measured motion of the motors. Bodies are free within what a drawing
promises. Passes: the linear model first; then {prescribed motion of the present model, Gauss-Newton steps}, until what
a pass changes is small against what is stated. Weights are differences between periods and one relative model error.
"""

from __future__ import annotations

import fnmatch
import logging
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from typing import Annotated, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    ConfigurationError,
    Context,
    Estimator,
    Fit,
    FloatArray,
    FreeParameters,
    ParameterTable,
    Record,
    Robot,
    RobotName,
    chosen_names,
    pattern_problems,
)
from robid_core.estimation.copies import refuse_copies
from robid_core.estimation.torque.nearest_friction import NearestFriction
from robid_core.residual import (
    Solution,
    TorqueProblem,
    default_patterns,
    estimated_robot,
    excited_range,
    friction_of_motors,
    functions_of_speed,
    leading_periods,
    misfit,
    misfit_table,
    refuse_weightless,
    resolved_width,
    solve,
    torque_problem,
    variant_robots,
    whole_pieces,
    words_of_pieces,
)
from robid_fit.motor_friction import are_alike, carried, curves_of, other_shapes, with_friction
from robid_fit.torque_doubts import doubts, unseen_sticks, with_rests
from robid_fit.torque_gain import common_scale_problem
from robid_fit.without_turns import Fitted, fitted_without_turns

REPLACED = ("coulomb", "offset", "speed")  # of the motors' friction, by free functions of speed
UNSEEN = ("controller", "sensor", "drive")
RELAID = 3  # times that functions of speed are laid anew
FAR = 2.0  # misfit of what did not converge: not just short of the minimum
SHORTEST_S = 1.0  # of a piece between gaps: a shorter one has few bins, and is mostly ends
STARTS_THEN = 8  # where the nominal robot's leads nowhere
DRAWN = ("stiffness", "damping", "friction")  # by starts; effects may have bounds that are near
LAGS = 3.0  # standard errors: a lag below is told by nobody


def _why_not_free(robot: Robot, name: str) -> str:
    """Say why this fit cannot free a parameter; empty where it can."""
    if robot.parameter_kind(name) in UNSEEN:
        return "the torque residual does not depend on it; hold it"
    if name.startswith("friction.") and name.endswith(REPLACED):
        return "free functions of speed stand in its place; free friction.*.viscous alone"
    return ""


def lag_words(lag: FloatArray, error: FloatArray) -> str:
    """Say by how much the torque lags, us, where any lag is more than chance makes of none; else nothing."""
    if not (np.abs(lag) > LAGS * error).any():
        return ""
    told = (f"{1e6 * own:.3g} ± {1e6 * sure:.2g}" for own, sure in zip(lag, error, strict=True))
    return f"; torque lags by {', '.join(told)} us"


def _at_bound(problem: TorqueProblem, point: FloatArray) -> npt.NDArray[np.bool_]:
    """Which free parameters stand at a bound of the search, (n_free,)."""
    bounded: npt.NDArray[np.bool_] = np.abs(point[: problem.n_free]) >= problem.free.upper * (1 - 1e-9)
    return bounded


def _leads_nowhere(problem: TorqueProblem, solution: Solution) -> bool:
    """Whether passes left a spring at a bound, or did not converge and left much."""
    bounded = np.flatnonzero(_at_bound(problem, solution.point))
    kinds = (problem.free.robot.parameter_kind(problem.free.names[i]) for i in bounded)
    return "stiffness" in kinds or (not solution.converged and misfit(problem, solution.point) > FAR)


class TorqueResidualFit(Estimator):
    """Fits a robot to the torque that its measured motion needs, in all bins up to a limit.

    Example::

        fit: {use: fit.torque_residual, with: {free: [gear_*, bearing_*, friction.*.viscous, mass.*, inertia.*]}}
    """

    free: tuple[str, ...] | None = None
    """Patterns of the parameters that are estimated, effects by `effect.<label>.*`; null: springs, dampers, viscous
    friction, and the inertia of bodies and rotors."""
    fixed: tuple[str, ...] = ()
    """Patterns of parameters that are held although `free` names them; `friction.*.speed` holds the transition speed of
    Coulomb friction, which is estimated otherwise."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations by pattern, in natural scales (0.01: one percent); wide for springs, 0.01 for bodies."""
    highest_hz: PositiveFloat = 100.0
    """Bins above are left out."""
    friction_widths: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] | None = None
    """Speeds of the free friction functions tanh(v / w), rad/s at the motor; null: about the robot file's
    `friction.*.speed`, about that of the data where it is another one, and up to the speeds that were measured."""
    model_error: PositiveFloat = 2e-4
    """Relative error of the model's torque per bin and axis, beside the noise."""
    delays: Literal["common", "each"] = "common"
    """Whether the measured torques of all axes have one delay, or each its own."""
    arm_side: tuple[
        Literal["joint_position", "joint_torque", "link_acceleration", "link_turn_rate"], ...
    ] = ()
    """Channels of sensors behind the gears that are fitted beside the torques, of the axes that have them: encoders at
    the links, torque sensors in the joints, accelerometers and gyroscopes on the links (`link_acceleration_x`, `_y` and
    `_z`, likewise `link_turn_rate`; the robot file says where they are, `sensors: {inertial: ...}` of the axis that
    moves the link). Their zeros do not count; gain and delay of each are unknowns. For motions that do not repeat the
    robot file has to state their noise, `sensors: {joint_position_noise: ..., joint_torque_noise: ..., inertial:
    {acceleration_noise: ..., turn_rate_noise: ...}}` of each axis that has them."""
    arm_side_gain: PositiveFloat = 0.01
    """Standard deviation of the gains of these sensors, relative."""
    arm_side_mounting_rad: PositiveFloat = 0.02
    """Standard deviation of the angles by which accelerometers and gyroscopes are turned on their links beside what the
    robot file says, rad; they are unknowns."""
    at_rest: Literal["leave_out", "keep"] = "leave_out"
    """What becomes of samples at which friction holds an axis by any torque up to its level: where it stands still, in
    motions that do not repeat, and where it turns back more abruptly than its angle resolves."""
    passes: PositiveInt = 12
    """Prescribed motions at most."""
    discard: NonNegativeInt | None = None
    """Leading periods dropped as transient; null: decided from the data, as many as differ from those after them."""
    starts: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Start points of the linear model: the nominal robot and random ones around it. null: the nominal robot, and eight
    where the fit does not converge from it, or a spring ends at a bound."""
    start_spread: PositiveFloat = 0.35
    """Standard deviation of the starts' logarithms around the nominal springs, dampers and viscous friction."""
    robots: dict[str, RobotName] = {}
    """Robots under which variants of a record were measured, where they are not the nominal one: `{loaded: arm.yaml}`;
    all share the free parameters."""
    constants: dict[str, str] = {}
    """Constants of the record that are parameters of the robot, `{payload_kg: effect.load.mass}`: each variant's robot
    has the value of its experiments, and needs no file under `robots`."""

    handles_variants: ClassVar[bool] = True
    names_several: ClassVar[bool] = True

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Patterns that mean nothing in this robot, and parameters that this fit cannot free."""
        patterns = default_patterns(robot) if self.free is None else self.free
        found = pattern_problems(
            robot, patterns, self.fixed, self.prior, lambda name: _why_not_free(robot, name)
        )
        return found or common_scale_problem(robot, chosen_names(list(robot.layout), patterns, self.fixed))

    def run(self, record: tuple[Record, ...], robot: Robot, context: Context) -> Fit:
        """Estimate the free parameters of the robot from one record, or several together."""
        if len(record) > 1:
            refuse_copies(record)
        whole = whole_pieces(record, SHORTEST_S, "fit.torque_residual", "record it without gaps")
        if words := words_of_pieces(record, whole):
            context.log.warning("fit.torque_residual %s", words)
        record = whole
        robot, robots = variant_robots(record, robot, self.robots, self.constants)
        for one in (robot, *robots.values()):
            refuse_weightless(one)
        fitted = self._solved(record, robot, robots, context)
        unseen: tuple[str, ...] = ()
        if self.at_rest == "leave_out":
            again = partial(self._solved, record, robot, robots, context)
            fitted, unseen = fitted_without_turns(fitted, again, context.log)
        problem, solution, friction, n_starts = fitted
        model = estimated_robot(
            robot, problem.blocks[0].laws, problem.free, solution.point, solution.covariance, friction
        )
        fit = self._result(problem, solution, n_starts)
        return fit.replace(
            parameters=with_friction(fit.parameters, robot, model),
            model=model,
            excited=excited_range(record),
            friction=curves_of(problem, solution.point, friction),
            stated_doubts=(
                *with_rests(fit.stated_doubts, record, problem),
                *unseen_sticks(unseen),
                *other_shapes(robot, friction),
            ),
        )

    def _solved(
        self,
        record: tuple[Record, ...],
        robot: Robot,
        robots: dict[str, Robot],
        context: Context,
        sticking: Collection[str] | None = None,
    ) -> Fitted:
        """Fit from the starts that are asked for; where none are and the nominal robot's leads nowhere, from several.

        Far from the minimum a resonance may be taken for its neighbour, and a spring then runs to a bound.
        """

        def solved(starts: int) -> tuple[TorqueProblem, Solution, int]:
            problem = self._problem(record, robot, robots, context.log, sticking=sticking)
            points = self._start_points(problem.free, starts, context.generator)
            solution = solve(
                problem,
                self.passes,
                self.model_error,
                context.progress,
                points,
                tell=lambda seen: context.log.info("%s", seen),
            )
            return problem, solution, starts

        found = solved(self.starts or 1)
        if self.starts is None and _leads_nowhere(*found[:2]):
            context.log.info("from the nominal robot the fit does not converge; from %d starts", STARTS_THEN)
            found = min(solved(STARTS_THEN), found, key=lambda one: misfit(one[0], one[1].point))
        problem, solution, n_starts = found
        about = self._about_its_width(record, robot, robots, problem, solution, context, sticking)
        return *about, n_starts

    def _about_its_width(
        self,
        record: tuple[Record, ...],
        robot: Robot,
        robots: dict[str, Robot],
        problem: TorqueProblem,
        solution: Solution,
        context: Context,
        sticking: Collection[str] | None,
    ) -> tuple[TorqueProblem, Solution, tuple[NearestFriction, ...]]:
        """Fit again with functions of speed about the width that friction has, where theirs was another one.

        The width in a robot file is often its default, and narrower friction is no sum of functions about it.
        """
        friction = self._friction(robot, problem, solution)
        for _ in range(0 if self.friction_widths else RELAID):
            width = resolved_width(robot, record[0].angle[0], np.array([own.width for own in friction]))
            motions = [block.motion for block in problem.blocks]
            if are_alike(problem.blocks[0].laws, functions_of_speed(robot, motions, None, width)):
                break
            other = self._problem(record, robot, robots, width=width, sticking=sticking)
            told = ", ".join(f"{own:.3g}" for own in width)
            context.log.info(
                "transition speed of Coulomb friction: %s rad/s; the free functions of speed are placed about it",
                told,
            )
            other.go_on_from(problem)
            begin = carried(problem, solution.point, other)
            again = solve(other, self.passes, self.model_error, context.progress, begin=begin)
            if misfit(other, again.point) > misfit(problem, solution.point):
                break
            problem, solution = other, replace(again, n_agree=solution.n_agree)
            friction = self._friction(robot, problem, solution)
        return problem, solution, friction

    def _friction(
        self, robot: Robot, problem: TorqueProblem, solution: Solution
    ) -> tuple[NearestFriction, ...]:
        """Friction in the numbers of a robot file; `friction.*.speed` among `fixed` stays."""
        laws = problem.blocks[0].laws
        held = [name for name in robot.layout if any(fnmatch.fnmatchcase(name, own) for own in self.fixed)]
        return friction_of_motors(
            robot, problem.speeds(), laws, problem.free, solution.point, solution.covariance, held
        )

    # Data and unknowns

    def _start_points(
        self, free: FreeParameters, starts: int, generator: np.random.Generator
    ) -> list[FloatArray]:
        """Coordinates of the starts beside the nominal robot, each (n_free,)."""
        drawn = np.array([free.robot.parameter_kind(name) in DRAWN for name in free.names])
        rows = generator.standard_normal((starts - 1, len(drawn)))
        return list(np.clip(self.start_spread * drawn * rows, free.lower, free.upper))

    def problem(self, record: tuple[Record, ...], robot: Robot) -> TorqueProblem:
        """Return what is minimised."""
        return self._problem(record, *variant_robots(record, robot, self.robots, self.constants))

    def _problem(
        self,
        record: tuple[Record, ...],
        robot: Robot,
        robots: dict[str, Robot],
        log: logging.Logger | None = None,
        width: FloatArray | None = None,
        sticking: Collection[str] | None = None,
    ) -> TorqueProblem:
        for place, message in self.problems_with(robot).items():
            raise ConfigurationError(f"{place[0]}: {message}")
        patterns = default_patterns(robot) if self.free is None else self.free
        return torque_problem(
            record,
            robot,
            chosen_names(list(robot.layout), patterns, self.fixed),
            self.prior,
            lambda nominal, motions: functions_of_speed(nominal, motions, self.friction_widths, width),
            robots=robots,
            discard=leading_periods(record, self.discard, log),
            highest_hz=self.highest_hz,
            each_delay=self.delays == "each",
            arm_side=self.arm_side,
            gain_prior=self.arm_side_gain,
            mounting_prior=self.arm_side_mounting_rad,
            leave_out_rests=self.at_rest == "leave_out",
            sticking=sticking,
        )

    # What is stated

    def _result(self, problem: TorqueProblem, solution: Solution, n_starts: int) -> Fit:
        free, n, point, covariance = problem.free, problem.n_free, solution.point, solution.covariance
        slope = np.eye(len(point))
        slope[:n, :n] = free.jacobian(point[:n])
        error = np.sqrt(np.diag(slope @ covariance @ slope.T))
        values = free.values(point[:n])
        nuisances = problem.nuisance_names()
        robot = free.robot
        kinds = tuple(robot.parameter_kind(name) for name in free.names)
        stiff = np.array([kind in ("stiffness", "effect") for kind in kinds] + [False] * len(nuisances))
        at_bound = np.concatenate((_at_bound(problem, point), np.zeros(len(nuisances), dtype=bool)))
        n_sensor = len(problem.sensors)
        n_turned = len(problem.mounted)
        n_friction = len(nuisances) - problem.n_delay - 2 * n_sensor - n_turned
        units = ["N m"] * n_friction + ["1"] * n_sensor + ["s"] * n_sensor
        units += ["rad"] * n_turned + ["s"] * problem.n_delay
        table = ParameterTable(
            names=free.names + nuisances,
            units=tuple(robot.parameter_unit(name) for name in free.names) + tuple(units),
            groups=kinds + ("nuisance",) * len(nuisances),
            start=np.concatenate((free.start, np.zeros(len(nuisances)))),
            estimate=np.concatenate((list(values.values()), point[n:])),
            standard_error=error,
            reported=stiff,
            at_bound=at_bound,
            prior=np.sqrt(((slope * problem.prior) ** 2).sum(axis=1)),
        )
        n_pass, last = len(solution.changes), solution.changes[-1]
        passes = "1 pass" if n_pass == 1 else f"{n_pass} passes"
        status = f"converged after {passes}" if solution.converged else f"{passes} did not suffice"
        if not solution.converged:
            status += (
                f"; the last one changed springs, dampers and effects by at most {last:.2g} standard errors"
            )
            if np.isfinite(solution.contraction):
                status += f", and each leaves {100 * solution.contraction:.2g} % of the way to the end"
        status += lag_words(problem.delay(point), error[len(error) - problem.n_delay :])
        return Fit(
            method="torque residual in all bins, friction as free functions of speed",
            status=status,
            converged=solution.converged,
            misfit=misfit(problem, point),
            misfit_table=misfit_table(problem, point),
            n_starts=n_starts,
            n_agree=solution.n_agree,
            parameters=table,
            covariance=covariance,
            free_names=free.names + nuisances,
            misfit_against=problem.blocks[0].noise_source,
            stated_doubts=doubts(problem, solution),
        )
