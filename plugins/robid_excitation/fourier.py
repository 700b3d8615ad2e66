"""Fourier trajectories for rigid-body and friction identification: large motions that tell all base parameters apart.

After Swevers et al. (1997); the search is in `estimation.excitation.fourier_trajectory`. Such a motion is not for a
frequency response: it has no lines. The excitation is one period of the motors' speed, at rest at both ends, so that
it may run once or be repeated.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from robid_core import (
    ConfigurationError,
    Configurations,
    Context,
    Excitation,
    ExcitationDesign,
    FloatArray,
    MotionRefused,
    Robot,
)
from robid_core.estimation.excitation.criteria import (
    Criterion,
    condition_number,
    hadamard_ratio,
    log_determinant,
)
from robid_core.estimation.excitation.fourier_trajectory import (
    Limits,
    TrajectoryProblem,
    fitted,
    rest_to_rest_basis,
    usual_column_scale,
)
from robid_core.estimation.excitation.trajectory_search import improved, search
from robid_core.estimation.rigid.rigid_torque import base_of, motor_torque
from robid_core.residual import rigid_drives
from robid_excitation.beforehand import problems_of, refuse_too_large
from robid_excitation.prediction import Cleared, Level, clear
from robid_excitation.rigid import (
    motion_limits,
    refuse_without_room,
    torque_noise,
    whole_samples,
)
from robid_excitation.simulated import predict

# Samples per half period of the highest harmonic, at least: the drives hold the speed between samples.
GUARD = 10
# Share of the evaluations that is kept until the simulation has said how the loops overshoot.
SECOND_SEARCH = 0.4
LEAST_ROOM = 0.1  # share of the way to a limit that the overshoot of the loops leaves in any case
# Where the simulated robot still goes beyond a limit, all motions are made smaller by these, one after another.
SMALLER = (1.0, 0.99, 0.97, 0.94, 0.9, 0.8)


def problem_of(robot: Robot, angle: FloatArray, settings: Fourier) -> TrajectoryProblem:
    """The search about one configuration, joint side, (n_axis,)."""
    drives = rigid_drives(robot)
    reach = np.full(robot.n_axis, np.inf if settings.reach_rad is None else settings.reach_rad)
    limits = motion_limits(robot, angle, reach, settings.margin)
    column, noise = base_of(drives).independent, torque_noise(robot)
    omega = 2 * np.pi * settings.harmonics / settings.period_s
    widest = motion_limits(robot, angle, np.full(robot.n_axis, np.inf), settings.margin)
    return TrajectoryProblem(
        drives=drives,
        limits=limits,
        centre=robot.motor_angle(angle),
        harmonics=settings.harmonics,
        period_s=settings.period_s,
        criterion=settings.criterion,
        noise=noise,
        column=column,
        column_scale=usual_column_scale(drives, widest, noise, column, omega),
    )


def speed_reference(coefficients: FloatArray, settings: Fourier, n_sample: int) -> FloatArray:
    """One period of the motors' speed, shape (n_config, 1, 1, n_sample, n_axis), from (n_config, n_axis, n_motion).

    Samples of the speed itself: their sum over the period vanishes, for no harmonic is a multiple of the sampling
    rate, so that the motors come back to where they began.
    """
    speed = rest_to_rest_basis(settings.harmonics, settings.period_s, n_sample).speed
    return np.stack([speed @ one.T for one in coefficients])[:, None, None]


def tightened(problem: TrajectoryProblem, coefficient: FloatArray, robot: Robot, n_sample: int) -> Limits:
    """Limits for the rigid robot under which the simulated one keeps those of `problem`, for motions like this one.

    The speed loops overshoot, lag and ring; by as much as they do so along this trajectory, the limits are drawn in.
    Torque and speed by the ratio of planned to simulated peaks, positions by what they went beyond the plan.
    """
    basis = rest_to_rest_basis(problem.harmonics, problem.period_s, n_sample)
    path, speed, acceleration = basis.motion(coefficient)
    path = problem.centre + path
    simulated = predict(robot, speed[None], problem.centre[None], np.zeros(0, dtype=np.int64))
    torque = np.abs(motor_torque(problem.drives, path[::GUARD], speed[::GUARD], acceleration[::GUARD]))
    above = np.maximum(simulated.upper[0] - path.max(axis=0), 0.0)
    below = np.maximum(path.min(axis=0) - simulated.lower[0], 0.0)
    limits, joint = problem.limits, np.abs(problem.drives.gear) @ np.maximum(above, below)
    centre, joint_centre = problem.centre, problem.drives.gear @ problem.centre
    return Limits(
        lower=np.minimum(limits.lower + below, centre - LEAST_ROOM * (centre - limits.lower)),
        upper=np.maximum(limits.upper - above, centre + LEAST_ROOM * (limits.upper - centre)),
        joint_lower=np.minimum(
            limits.joint_lower + joint, joint_centre - LEAST_ROOM * (joint_centre - limits.joint_lower)
        ),
        joint_upper=np.maximum(
            limits.joint_upper - joint, joint_centre + LEAST_ROOM * (limits.joint_upper - joint_centre)
        ),
        speed=limits.speed * _share(np.abs(speed).max(axis=0), simulated.speed[0]),
        acceleration=limits.acceleration,
        torque=limits.torque * _share(torque.max(axis=0), simulated.torque[0]),
    )


class Fourier(ExcitationDesign):
    """Speed references of sines and cosines, most informative about inertia and friction within the robot's limits.

    One trajectory for each configuration, about it and at rest at both ends; several complete one another. Limits of
    position, speed, acceleration and torque hold for the rigid robot and are checked on the simulated one. For
    `fit.rigid`; a frequency response cannot be made of it.

        excite:
          use: excitation.fourier
          with: {period_s: 10, harmonics: 5, criterion: log_det}
    """

    period_s: PositiveFloat = 10.0
    """Length of one period, s."""
    harmonics: int = Field(default=5, ge=2, le=100)
    """Multiples of the base frequency 1 / period_s; the highest must stay well below the first resonance."""
    criterion: Criterion = "log_det"
    """What is optimised of the regressor of the base parameters, friction included: log_det (smallest joint
    uncertainty), condition (number, columns over their usual size), hadamard (ratio of Hadamard's inequality)."""
    reach_rad: PositiveFloat | None = None
    """How far a joint may go from its configuration, rad (m); by default as far as its limits allow."""
    margin: float = Field(default=0.9, gt=0, le=1)
    """Share of the torque, speed and acceleration limits that may be used."""
    draws: PositiveInt = 30
    """Random trajectories that are tried first, for each configuration."""
    starts: PositiveInt = 2
    """The best of them from which the search goes on."""
    evaluations: PositiveInt = 400
    """Evaluations of the criterion for each configuration, those of the random trajectories included."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.evaluations < self.draws:
            raise ValueError(
                f"evaluations: {self.evaluations} are fewer than the {self.draws} draws; ask for more, or draw less"
            )
        return self

    @property
    def excites_lines(self) -> bool:
        """No: the motion is not for a frequency response."""
        return False

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """A period that the robot's sampling does not hold, and too much memory."""
        return problems_of(
            [
                lambda: whole_samples(self.period_s, robot, "period_s"),
                lambda: refuse_too_large("period_s", self.period_s, 1, robot),
            ]
        )

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        counts = [getattr(stage, "count", None) for stage in upstream.values()]
        count = next((number for number in counts if isinstance(number, int)), None)
        trajectories = "1 trajectory" if count == 1 else f"{count} trajectories"
        where = "one trajectory for each configuration" if count is None else trajectories
        far = "as far as the joints go" if self.reach_rad is None else f"up to {self.reach_rad:g} rad away"
        return [
            f"{where} of {self.period_s:g} s, from rest to rest, {self.harmonics} harmonics up to "
            f"{self.harmonics / self.period_s:.4g} Hz, {far}",
            f"criterion {self.criterion}, {self.evaluations} evaluations each; not for a frequency response",
        ]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Search a trajectory about each configuration and clear all of them by simulation."""
        n_sample = whole_samples(self.period_s, robot, "period_s")
        if 2 * self.harmonics * GUARD >= n_sample:
            raise ConfigurationError(
                f"harmonics: {self.harmonics / self.period_s:g} Hz is not below a tenth of half the sampling rate of "
                f"{robot.name}, {0.5 / robot.sample_time_s:g} Hz; take fewer, or a longer period"
            )
        problems = [problem_of(robot, angle, self) for angle in configurations.angle]
        for number, (problem, angle) in enumerate(zip(problems, configurations.angle, strict=True)):
            refuse_without_room(robot, problem.drives, problem.limits, angle, f"configuration {number + 1}")
        coefficients = self._searched(problems, robot, n_sample, context)
        coefficients, cleared = self._cleared(
            problems, coefficients, configurations, robot, n_sample, context
        )
        gram = np.sum([p.gram(one) for p, one in zip(problems, coefficients, strict=True)], axis=0)
        context.log.info(
            "%d base parameters: condition number %.4g, log det %.4g, Hadamard ratio %.3g",
            len(problems[0].column),
            condition_number(gram),
            log_determinant(gram),
            hadamard_ratio(gram),
        )
        return Excitation(
            axis_names=robot.axis_names,
            sample_time_s=robot.sample_time_s,
            slow_sine_bin=0,
            line=np.zeros(0, dtype=np.int64),
            reference=speed_reference(coefficients, self, n_sample),
            slow_sine_speed=np.zeros(robot.n_axis),
            **cleared.artifact_fields(),
        )

    def _searched(
        self, problems: list[TrajectoryProblem], robot: Robot, n_sample: int, context: Context
    ) -> FloatArray:
        """Coefficients of all configurations, each searched with those before it, (n_config, n_axis, n_motion)."""
        found, known = [], None
        total = self.evaluations * len(problems)
        for number, alone in enumerate(problems):
            note, done = f"trajectory {number + 1} of {len(problems)}", number * self.evaluations
            tell = functools.partial(_tell, context, total, note)
            problem = replace(alone, before=known)
            first = self.evaluations - int(SECOND_SEARCH * (self.evaluations - self.draws))
            trajectory = search(
                problem, context.generator, self.draws, self.starts, first, functools.partial(tell, done)
            )
            inner = replace(problem, limits=tightened(problem, trajectory.coefficient, robot, n_sample))
            rest = functools.partial(tell, done + first)
            best, _ = improved(inner, trajectory.coefficient, self.evaluations - first, rest)
            best = fitted(replace(problem, limits=tightened(problem, best, robot, n_sample)), best)
            gram = problem.gram(best)
            known = gram if known is None else known + gram
            found.append(best)
            gain = trajectory.random_cost - problem.cost(best)
            context.log.info(
                "%s: %s better by %.3g than the best of %d random ones",
                note,
                self.criterion,
                gain,
                self.draws,
            )
        context.progress(total, total, "trajectories are found")
        return np.stack(found)

    def _cleared(
        self,
        problems: list[TrajectoryProblem],
        coefficients: FloatArray,
        configurations: Configurations,
        robot: Robot,
        n_sample: int,
        context: Context,
    ) -> tuple[FloatArray, Cleared]:
        """Largest of the motions that the simulated robot may do, with its prediction."""
        reach = float("inf") if self.reach_rad is None else self.reach_rad
        widest = max(float(_reach(p, c).max()) for p, c in zip(problems, coefficients, strict=True))
        level = Level("reach_rad", min(reach, widest), 0.0)
        refused: MotionRefused | None = None
        for factor in SMALLER:
            smaller = np.stack([fitted(p, factor * c) for p, c in zip(problems, coefficients, strict=True)])
            fast = speed_reference(smaller, self, n_sample)
            try:
                cleared = clear(
                    fast,
                    np.zeros_like(fast),
                    configurations.angle,
                    robot,
                    np.zeros(0, dtype=np.int64),
                    self.margin,
                    level,
                )
            except MotionRefused as error:
                refused = refused or error
                continue
            if factor < 1:
                context.log.info(
                    "all motions made smaller by %.2f for the simulated robot: %s", factor, refused
                )
            return smaller, cleared
        assert refused is not None
        raise refused


def _share(planned: FloatArray, simulated: FloatArray) -> FloatArray:
    """Planned over simulated peaks, at most 1; 1 where nothing is simulated to move."""
    share: FloatArray = np.minimum(planned / np.where(simulated > 0, simulated, 1.0), 1.0)
    return np.where(simulated > 0, share, 1.0)


def _tell(context: Context, total: int, note: str, before: int, done: int) -> None:
    context.progress(before + done, total, note)


def _reach(problem: TrajectoryProblem, coefficient: FloatArray) -> FloatArray:
    """How far each joint goes from its configuration, rad (m), (n_axis,)."""
    position = problem.basis(16 * problem.harmonics).motion(coefficient)[0]
    reach: FloatArray = np.abs(position @ problem.drives.gear.T).max(axis=0)
    return reach
