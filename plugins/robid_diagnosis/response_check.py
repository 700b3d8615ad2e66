"""An independent check of stiffnesses: estimated again from frequency responses, with the robot that a diagnosis found.

The torque residual weighs all bins and simulates the motion; responses see the excited lines only, through another
estimator and the linear model. What both say of a stiffness may differ by the errors that they state, by those that
they grant to their models (one alike at all lines moves a stiffness by about as much, and no scatter shows it), and by
the bias of responses: a ratio of noisy spectra is off by up to its relative variance. That is little where friction's
distortion could be taken off, which takes a recorded reference, and percents where it could not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from robid_core import (
    Artifact,
    ConfigurationError,
    Context,
    DataRejected,
    Estimator,
    Finding,
    Fit,
    FloatArray,
    FrfEstimator,
    Model,
    Preprocessing,
    Record,
    ResponseCheck,
    RobidError,
    Robot,
    Stage,
    StageRef,
    Timing,
)
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.results import unknown

CHANCE = 1e-3  # that any of all stiffnesses of a robot is told to disagree though none does
TELLING = 0.05  # relative error: responses that know a stiffness less well say nothing of it, and are biased by more
LOST = 0.25  # of the variance of a response's logarithm
STAGES = (Preprocessing, FrfEstimator, Estimator)


@dataclass(frozen=True)
class Chain:
    """Stages from a record to a fit of its responses, with the names of their plugins."""

    uses: tuple[str, ...]
    stages: tuple[Stage, ...]

    @classmethod
    def of(cls, references: Sequence[StageRef]) -> Chain:
        """Check stages and their settings; ConfigurationError for stages that lead elsewhere."""
        chain = cls(tuple(one.use for one in references), tuple(one.stage() for one in references))
        made: list[type[Artifact]] = [Record]
        for i, stage in enumerate(chain.stages, start=1):
            needed = [one.artifact for one in stage.inputs() if not one.optional]
            fed = set(needed) <= set(made) and set(stage.lends().values()) <= {Robot, Context}
            last = i == len(chain.stages)
            if not (isinstance(stage, STAGES) and fed and (isinstance(stage, Estimator) or not last)):
                raise ConfigurationError(
                    f"diagnosis.effects: '{chain.uses[i - 1]}' has no place there: response_check is a list of stages "
                    "that lead from a record to a fit, such as [frf.lrm, fit.log_response]"
                )
            made.append(stage.output)
        return chain

    def run(self, record: Record, robot: Robot, context: Context) -> tuple[Fit, str]:
        """Run one after the other on what those before made, and return the fit and the stages that were used.

        What prepares a record is left out where the record lacks what it takes, a reference most of all.
        """
        made, used = list[Artifact]([record]), list[str]()
        (generator,) = context.generator.spawn(1)  # what a diagnosis draws stays as it is
        lent = {Robot: robot, Context: replace(context, generator=generator)}
        for use, stage in zip(self.uses, self.stages, strict=True):
            arguments: dict[str, object] = {name: lent[kind] for name, kind in stage.lends().items()}
            for entry in stage.inputs():
                found = [one for one in made if isinstance(one, entry.artifact)]
                if found or entry.many:
                    arguments[entry.name] = tuple(found) if entry.many else found[-1]
            try:
                made.append(stage.run(**arguments))
            except DataRejected as error:
                if not isinstance(stage, Preprocessing):
                    raise
                context.log.info("%s is left out before responses are estimated: %s", use, error)
                continue
            used.append(use)
        fit = made[-1]
        assert isinstance(fit, Fit)
        return fit, ", ".join(used)


def response_check_of(
    chain: Chain, case: Case, final: Fitted, model: Model, timing: Timing, context: Context
) -> ResponseCheck:
    """Estimate the stiffnesses of the found robot from responses; where that is impossible, say why."""
    robot = final.problem.free.robot
    if not any(robot.parameter_kind(name) == "stiffness" for name in robot.layout):
        return _none("the robot has no spring whose stiffness they would give")
    record, why = periodic_record(case.nominal_records, case.told.n_axis)
    if record is None:
        return _none(why)
    try:
        fit, method = chain.run(on_time(record, timing, case.discard), Robot.of_model(model), context)
    except (RobidError, np.linalg.LinAlgError) as error:
        return _none(" ".join(str(error).split()))
    if not fit.converged:
        return _none(f"the fit of the responses did not converge ({fit.status})")
    return compared(fit, method, final, case.model_error)


def compared(fit: Fit, method: str, final: Fitted, model_error: float) -> ResponseCheck:
    """Hold each stiffness of a fit of responses against that of a torque fit, of that relative error of the model."""
    table = fit.parameters
    # Responses that misfit know less than their weights say.
    scatter = table.standard_error * np.sqrt(max(1.0, fit.misfit))
    alike = np.hypot(fit.model_error or 0.0, response_bias(fit)) * table.estimate
    error = np.hypot(scatter, alike)
    bent = nonlinear_springs(final.robot)
    rows = [
        i
        for i, name in enumerate(table.names)
        if table.groups[i] == "stiffness"
        and name in final.problem.free.names
        and name not in bent
        and error[i] < TELLING * table.estimate[i]
    ]
    if not rows:
        linear = " of a linear spring" if bent else ""
        return _none(f"the responses determine no stiffness{linear} to {100 * TELLING:.0f} % or better")
    names = tuple(table.names[i] for i in rows)
    by_torques, torques_error = np.array([final.estimate(name) for name in names]).T
    by_responses, responses_error = table.estimate[rows], error[rows]
    torques_error = np.hypot(torques_error, model_error * by_torques)
    return ResponseCheck(
        method,
        "",
        fit.misfit,
        float(scipy.stats.norm.isf(CHANCE / (2 * len(rows)))),
        names,
        tuple(table.units[i] for i in rows),
        by_responses,
        responses_error,
        by_torques,
        torques_error,
        (by_responses - by_torques) / np.hypot(responses_error, torques_error),
    )


def nonlinear_springs(robot: Robot) -> set[str]:
    """Stiffnesses beside which a law acts: of a gap, or a spring that hardens, a response has another slope."""
    places = [bound.place for bound in robot.effects]
    return {f"{place.side}_stiffness.{place.name}" for place in places if place.side in ("gear", "bearing")}


def response_bias(fit: Fit) -> float:
    """Relative variance of the responses of motors to their own torques, the mean over lines: NaN if it is not known.

    Responses that are lost in noise, which the fit gives no weight, are left out.
    """
    told = fit.response
    if told is None:
        return float("nan")
    deviation, modelled = (np.diagonal(one, axis1=2, axis2=3) for one in (told.deviation, told.modelled))
    variance = (deviation / np.abs(modelled)) ** 2
    heard = variance < LOST
    return float(variance[heard].mean()) if heard.any() else float("nan")


def disagreements(response_check: ResponseCheck | None) -> tuple[Finding, ...]:
    """Return a finding for each stiffness about which responses and torques disagree."""
    if response_check is None:
        return ()
    n = len(response_check.names)
    return tuple(
        unknown(
            f"responses and torques disagree about {response_check.names[i]}",
            response_check.names[i].partition(".")[2],
            float(response_check.z[i] ** 2),
            min(1.0, 2 * n * float(scipy.stats.norm.sf(abs(response_check.z[i])))),
        )
        for i in np.flatnonzero(~response_check.agree)
    )


def on_time(record: Record, timing: Timing, discard: int) -> Record:
    """Return a periodic record with its torques as early as a fit found them late, leading periods dropped."""
    run = record.run
    torque = run.channel("motor_torque")
    n_sample = len(run.time_s)
    turn = (
        2 * np.pi * np.fft.rfftfreq(n_sample)[:, None] * timing.lag * timing.sample_time_s / run.sample_time_s
    )
    spectrum = np.fft.rfft(torque.values, axis=4) * np.exp(1j * turn)
    channels = {
        **run.channels,
        "motor_torque": torque.replace(values=np.fft.irfft(spectrum, n_sample, axis=4)),
    }
    kept = {
        name: channel.replace(values=channel.values[:, :, :, discard:]) for name, channel in channels.items()
    }
    return record.replace(runs=(run.replace(channels=kept, valid=run.valid[:, :, :, discard:]),))


def periodic_record(records: Sequence[Record], n_axis: int) -> tuple[Record | None, str]:
    """Return the record of most experiments that gives responses; where none does, why the first does not."""
    reasons = [_why_not(record, n_axis) for record in records]
    useful = [record for record, why in zip(records, reasons, strict=True) if not why]
    if useful:
        return max(useful, key=lambda record: record.run.valid[..., 0, 0].size), ""
    return None, reasons[0] if reasons else "no record is of the nominal robot"


def _why_not(record: Record, n_axis: int) -> str:
    """Say why a record gives no response of all axes; empty where it does."""
    if record.line is None and record.runs[0].n_period > 1:
        return (
            "the record has periods, but no excited frequencies (`excited_hz` of Record.from_arrays, `lines` of a "
            "channel map); it was taken as one that does not repeat"
        )
    if record.line is None or len(record.runs) != 1:
        return "the record does not repeat"
    n_exp = record.run.valid.shape[2]
    if n_exp < n_axis:
        return f"a response of {n_axis} axes takes as many experiments a block, and there {_count(n_exp)}"
    return ""


def _count(number: int) -> str:
    return "is one" if number == 1 else f"are {number}"


def _none(reason: str) -> ResponseCheck:
    none: FloatArray = np.empty(0)
    return ResponseCheck("", reason, float("nan"), float("nan"), (), (), none, none, none, none, none)
