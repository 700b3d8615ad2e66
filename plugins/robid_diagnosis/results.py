"""What a search told, as artifacts: findings, torque that each model leaves, values, the extended robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from robid_core import (
    ComplexArray,
    Finding,
    FloatArray,
    Model,
    ParameterTable,
    PredictionErrors,
    Record,
    Robot,
    SeparatingExperiment,
    Timing,
)
from robid_core.residual import estimated_robot
from robid_diagnosis.held_out import held_out_residuals
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.intervals import intervals, relative_errors
from robid_diagnosis.selection import Outcome, Step, least_gain
from robid_diagnosis.wording import place_text

CAUSE = 0.9  # of the gain of free functions: what explains less is a part of the cause
STILL = 1e-3  # of travel at the joint, rad or m


def finding_of(
    robot: Robot, final: Fitted, step: Step, separation: SeparatingExperiment | None = None
) -> Finding:
    """Return a cause that was accepted, with the values that the last fit gives it, and what tells it from its ties."""
    names = step.names
    estimates = [final.estimate(name) for name in names]
    told = [robot.parameter(name) if name in robot.layout else float("nan") for name in names]
    if step.kind != "effect":
        kind = "value"
    elif not step.share < CAUSE:
        kind = "cause"
    else:
        kind = "partial"
    picture = step.picture
    return Finding(
        kind=kind,
        effect=step.use,
        on=step.on or "",
        side=step.side or "",
        names=tuple(name.rpartition(".")[2] if step.kind == "effect" else name for name in names),
        units=tuple(final.problem.free.robot.parameter_unit(name) for name in names),
        told=np.array(told),
        value=np.array([value for value, _ in estimates]),
        standard_error=np.array([error for _, error in estimates]),
        gain=step.gain,
        p_value=step.p_value,
        share=step.share,
        ties=tuple(place_text(*tie) for tie in step.ties),
        by_configuration=step.by_configuration,
        held_out=step.held_out,
        variable=picture.variable if picture else "",
        abscissa=picture.abscissa if picture else None,
        residual=picture.residual if picture else None,
        explained=picture.explained if picture else None,
        separation=separation,
    )


def unknown_of(outcome: Outcome) -> tuple[Finding, ...]:
    """What no effect explains and free functions of some variable would."""
    left = outcome.left
    least = least_gain(outcome.final.misfit, [step.gain for step in outcome.steps])
    if left is None or left.gain <= least:
        return ()
    none = np.empty(0)
    return (
        Finding(
            kind="unknown",
            effect=f"a function of {left.variable}",
            on=left.axis,
            side="",
            gain=left.gain,
            p_value=min(
                1.0, outcome.searches[-1].trials * float(scipy.stats.chi2.sf(left.gain, left.freedom))
            ),
            share=float("nan"),
            names=(),
            units=(),
            told=none,
            value=none,
            standard_error=none,
            by_configuration=none,
            held_out=none,
        ),
    )


def errors_of(
    records: Sequence[Record], robot: Robot, outcome: Outcome, generator: np.random.Generator
) -> tuple[tuple[PredictionErrors, ...], FloatArray]:
    """Torque that each model leaves in data that were left out of its fit, and what the last gains, an interval (2,).

    In the data of its fit, where one model would be another without some of them. Experiments are drawn again for the
    intervals.
    """
    models = {"robot file, values refitted": outcome.base, "extended robot": outcome.final}
    if not outcome.steps:
        models.popitem()
    runs = [run for record in records for run in record.runs]
    travels = [np.ptp(robot.joint_angle(run.lanes("motor_position")), axis=1) for run in runs]
    still = np.concatenate(travels).max(axis=0) < STILL
    held_out = [held_out_residuals(fitted) for fitted in models.values()]
    known: list[list[ComplexArray]] = [one for one in held_out if one is not None]
    where = "configurations left out of its fit"
    if len(known) < len(models):
        known, where = [one.problem.residuals(one.point) for one in models.values()], "the data of its fit"
    power = _sums([block.motion.torque_spectrum for block in outcome.base.problem.blocks])
    errors = np.stack([_sums(one) for one in known])
    found = intervals(errors, power, generator)
    relative = relative_errors(errors.sum(axis=1), power.sum(axis=0))
    rows = tuple(
        PredictionErrors(
            model=name,
            quantity=f"torque that the model leaves in {where}, all bins but the mean",
            unit_symbol=records[0].runs[0].channel("motor_torque").unit_symbol,
            axis_names=robot.axis_names,
            rms=np.sqrt(2 * errors[m].mean(axis=0)),
            relative=relative[m],
            low=found.relative[0, m],
            high=found.relative[1, m],
            still=still,
        )
        for m, name in enumerate(models)
    )
    return rows, found.gain


def _sums(spectra: Sequence[ComplexArray]) -> FloatArray:
    """Power of each experiment, the mean left out, (n_experiment, n_axis)."""
    return np.concatenate(
        [(np.abs(one[:, :, 1:]) ** 2).sum(axis=2).reshape(-1, one.shape[-1]) for one in spectra]
    )


def values_of(final: Fitted) -> ParameterTable:
    """All parameters of the robot that were estimated: told, found, how sure."""
    problem = final.problem
    robot, names = problem.free.robot, problem.free.names
    rows = [final.estimate(name) for name in names]
    told = problem.free.start
    slope = problem.free.jacobian(final.point[: problem.n_free])
    prior = np.sqrt(((slope * problem.prior[: problem.n_free]) ** 2).sum(axis=1))
    kinds = tuple(robot.parameter_kind(name) for name in names)
    return ParameterTable(
        names=names,
        units=tuple(robot.parameter_unit(name) for name in names),
        groups=kinds,
        start=told,
        estimate=np.array([value for value, _ in rows]),
        standard_error=np.array([error for _, error in rows]),
        reported=np.array([kind in ("stiffness", "effect") for kind in kinds]),
        at_bound=np.zeros(len(names), dtype=bool),
        prior=prior,
    )


def timing_of(final: Fitted) -> Timing:
    """How late the torque of each axis is, in samples of the first block."""
    problem = final.problem
    motion = problem.blocks[0].motion
    deviation = np.sqrt(np.diag(final.solution.covariance))[-problem.n_delay :]
    return Timing(
        problem.free.robot.axis_names,
        motion.sample_time_s,
        problem.delay(final.point) / motion.sample_time_s,
        deviation / motion.sample_time_s,
    )


def model_of(robot: Robot, case: Case, final: Fitted) -> Model:
    """The robot that was found, effects and all."""
    problem = final.problem
    extended = final.hypothesis.robot(robot)
    if case.friction_speed is not None:
        extended = extended.with_parameters(
            {
                f"friction.{axis}.speed": float(width)
                for axis, width in zip(robot.axis_names, case.friction_speed, strict=True)
            }
        )
    motions = [block.motion for block in problem.blocks]
    laws = problem.blocks[0].laws
    return estimated_robot(extended, motions, laws, problem.free, final.point, final.solution.covariance)
