"""Friction before it slides: a spring and a damper for each motor, from motions far below the breakaway."""

from __future__ import annotations

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat

from robid_core import (
    ConfigurationError,
    Context,
    DataRejected,
    Estimator,
    Fit,
    ParameterTable,
    Record,
    Robot,
)
from robid_core.estimation.rigid.regression import smooth
from robid_core.estimation.rigid.rigid_torque import motor_torque
from robid_core.residual import leading_periods
from robid_fit.bristles import Bristles, SmallMotion, bristles_of, slid_share
from robid_fit.friction_effects import refuse_other_laws
from robid_fit.plateau_torques import without_friction
from robid_fit.rigid_model import experiments, motion_of

STRIBECK = "friction.stribeck"
FAST = 1e4  # rad/s: a Stribeck speed where there is no Stribeck curve


class PreslidingFit(Estimator):
    """Stiffness and damping of presliding friction (bristles), from motions so small that the motor sticks.

    Weight and inertia of the rigid robot are taken off; what is left over angle and speed is the spring sigma_0 and the
    damper sigma_1, beside the viscous coefficient that the robot has. It becomes `friction.lugre` with the robot's own
    Coulomb level, which `fit.friction` finds: take its robot by `inputs: {robot: ...}`. Motion that slides is refused.

        bristles:
          use: fit.presliding
          inputs: {record: small, robot: friction}
          with: {cutoff_hz: 30}
    """

    cutoff_hz: PositiveFloat = 30.0
    """Edge of the low-pass on angle and torque: above the motion, below the lowest resonance."""
    largest_slide: float = Field(default=0.2, gt=0, lt=1)
    """Energy lost per path over the Coulomb level, above which a record slides. Dahl's friction has a third of the
    ratio of amplitude to breakaway displacement, and its apparent stiffness falls about as much."""
    least_rad: NonNegativeFloat = 1e-7
    """Root mean square of a motor's angle below which it stands."""
    discard: NonNegativeInt | None = None
    """Leading periods left out of a periodic record; null: decided from the data, as many as differ from
    those after them."""

    def uses(self) -> list[tuple[str, str]]:
        """The effect that comes into the robot."""
        return [("robid.effects", "friction.lugre")]

    def run(self, record: Record, robot: Robot, context: Context) -> Fit:
        """Look at each axis that moves, estimate, put the bristles into the robot."""
        rubbing = [k for k, e in robot.description.effects.items() if e.use == STRIBECK]
        refuse_other_laws(robot.without_effect(*rubbing), "fit.presliding")
        motions = self._motions(record, robot, leading_periods((record,), self.discard, context.log))
        found: dict[str, Bristles] = {}
        for axis, own in motions.items():
            if not own:
                context.log.info("%s moves too little: nothing is estimated for it", axis)
                continue
            coulomb = _level(robot, axis)
            share = slid_share(own, coulomb)
            if share > self.largest_slide:
                raise DataRejected(
                    f"fit.presliding: {axis} slides: per path it loses {100 * share:.0f} % of its Coulomb level of "
                    f"{coulomb:.4g} N m; move it less, or leave the axis at rest"
                )
            found[axis] = bristles_of(own)
            context.log.info(
                "%s: %.4g N m/rad before it slides, loss %.1f %%", axis, found[axis].stiffness, 100 * share
            )
        if not found:
            raise DataRejected("fit.presliding: no motor moves; excite it by less than its Coulomb level")
        return _result(robot, found)

    def _motions(self, record: Record, robot: Robot, discard: int) -> dict[str, list[SmallMotion]]:
        """Small motions of each axis, one for each experiment in which it moves."""
        drives = without_friction(robot)
        result: dict[str, list[SmallMotion]] = {axis: [] for axis in robot.axis_names}
        for run in record.runs:
            for position, torque in experiments(run, robot, discard, stage="fit.presliding"):
                motion = motion_of(position, run.sample_time_s, self.cutoff_hz, order=2)
                edge = round(2.0 / (self.cutoff_hz * run.sample_time_s))
                kept = slice(edge, len(position) - edge)
                if kept.stop - kept.start < 4 * edge:
                    raise DataRejected(
                        f"fit.presliding: an experiment is shorter than {6 * edge * run.sample_time_s:.3g} s; record "
                        "longer, or raise cutoff_hz"
                    )
                q, v, a = (x[kept] for x in (motion.position, motion.velocity, motion.acceleration))
                rest = smooth(torque, run.sample_time_s, self.cutoff_hz, 2)[kept] - motor_torque(
                    drives, q, v, a
                )
                for k, axis in enumerate(robot.axis_names):
                    if q[:, k].std() > self.least_rad:
                        result[axis].append(SmallMotion(q[:, k] - q[:, k].mean(), v[:, k], rest[:, k]))
        return result


def _level(robot: Robot, axis: str) -> float:
    """Torque at which an axis breaks away."""
    level = robot.parameter(f"friction.{axis}.coulomb")
    for label, entry in robot.description.effects.items():
        if entry.use == STRIBECK and entry.on == axis:
            level += robot.parameter(f"effect.{label}.breakaway")
    if not level > 0:
        raise ConfigurationError(
            f"fit.presliding: friction.{axis}.coulomb is zero, and nothing says when it slides; take the robot of "
            "fit.friction"
        )
    return level


def _result(robot: Robot, found: dict[str, Bristles]) -> Fit:
    """Everything of all axes, in a robot whose friction has bristles."""
    extended, held = robot, dict[str, float]()
    names, units, value = list[str](), list[str](), list[float]()
    covariance = np.zeros((2 * len(found), 2 * len(found)))
    for number, (axis, bristles) in enumerate(found.items()):
        viscous = robot.parameter(f"friction.{axis}.viscous")
        coulomb, breakaway, speed = robot.parameter(f"friction.{axis}.coulomb"), _level(robot, axis), FAST
        for label, entry in robot.description.effects.items():
            if entry.use == STRIBECK and entry.on == axis:
                speed = robot.parameter(f"effect.{label}.stribeck_speed")
                extended = extended.without_effect(label)
        label = f"bristles_{axis}"
        values = {
            "coulomb": coulomb,
            "breakaway": breakaway,
            "stribeck_speed": speed,
            "stiffness": max(bristles.stiffness, 1e-6),
            "damping": max(bristles.damping - viscous, 0.0),
            "viscous": viscous,
        }
        extended = extended.with_effect(label, "friction.lugre", axis, "motor", values)
        held |= {f"friction.{axis}.coulomb": 0.0, f"friction.{axis}.viscous": 0.0}
        own = [f"effect.{label}.stiffness", f"effect.{label}.damping"]
        names += own
        units += [extended.parameter_unit(name) for name in own]
        value += [bristles.stiffness, bristles.damping - viscous]
        covariance[2 * number : 2 * number + 2, 2 * number : 2 * number + 2] = bristles.covariance
    extended = Robot(extended.description, robot.dynamics, robot.base or robot.description)
    error = np.sqrt(np.diag(covariance))
    wrong = [name for name, x, e in zip(names, value, error.tolist(), strict=True) if x < -2 * e]
    numbers = {name: extended.parameter(name) for name in names}
    status = f"small motions of {', '.join(found)}"
    return Fit(
        method="friction before it slides, least squares over angle and speed",
        status=f"not physical: {', '.join(wrong)} negative; {status}" if wrong else status,
        converged=not wrong,
        misfit=1.0,
        misfit_against="",  # what the line leaves itself gives the noise level
        n_starts=1,
        n_agree=1,
        parameters=ParameterTable(
            names=tuple(names),
            units=tuple(units),
            groups=("friction",) * len(names),
            start=np.zeros(len(names)),
            estimate=np.array(value, dtype=np.float64),
            standard_error=error,
            reported=np.ones(len(names), dtype=bool),
            at_bound=np.zeros(len(names), dtype=bool),
        ),
        covariance=covariance,
        free_names=tuple(names),
        model=extended.model({**held, **numbers}, names, covariance),
    )
