"""Measuring through the drives: every experiment of the excitation in every configuration.

All motions are cleared by the safety gate before the first one begins. What comes back is judged at once:
torque at its limit, and motor angles that do not close from period to period, make the data useless for a
frequency response. Motions without lines (trajectories, sweeps) are for other uses: there a drift is told, no more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import numpy.typing as npt
import scipy
from pydantic import Field, PositiveFloat

from robid_core import (
    Acquisition,
    AxisKey,
    ConfigurationError,
    Configurations,
    Context,
    DataRejected,
    Drives,
    Excitation,
    Experiment,
    ExperimentIndex,
    FloatArray,
    MotionAborted,
    MotionRefused,
    RawLog,
    Record,
    RecordPlan,
    Robot,
    Session,
    Trace,
    assemble_record,
    clear_motion,
    load_plugin,
)

MOST_PERIODS = 10_000  # of an experiment; a robot that moves for hours is told by a mistyped number
UNSATURATED = 3.9  # standard deviations of a Gaussian torque that the limit should be away: 1 sample in 10^4


def plan_experiments(
    configurations: Configurations,
    excitation: Excitation,
    robot: Robot,
    periods: int,
    traced: int,
    seeds: npt.NDArray[np.int64],
) -> dict[ExperimentIndex, Experiment]:
    """Every experiment by (configuration, block, experiment), each cleared by the safety gate.

    Parameters
    ----------
    periods, traced
        How often each reference runs, and how many of the last periods are kept.
    seeds
        One per experiment, shape (n_config, n_block, n_exp).

    Raises
    ------
    MotionRefused
        From the gate, with the place of the experiment, before anything was sent.
    """
    limits = robot.limits
    experiments = {}
    for c, middle in enumerate(robot.motor_angle(configurations.angle)):
        realization, offset = excitation.realization(c), excitation.start_offset(c)
        for b, e in np.ndindex(*realization.shape[:2]):
            label = f"configuration {c + 1}, block {b + 1}, experiment {e + 1}"
            reference = np.ascontiguousarray(realization[b, e])
            start = middle - offset[b, e]  # the motion goes about the configuration, not away from it
            try:
                clearance = clear_motion(start, reference, excitation.sample_time_s, periods, limits)
            except MotionRefused as error:
                raise MotionRefused(f"{label}: {error}") from error
            experiments[c, b, e] = Experiment(
                label,
                start,
                reference,
                periods,
                traced,
                excitation.sample_time_s,
                int(seeds[c, b, e]),
                clearance,
            )
    return experiments


def drift_per_period(position: FloatArray) -> FloatArray:
    """How far the motor angles are from closing, in rad, shape (n_axis,).

    Mean over the samples of one period minus the period before it, the largest over the periods; noise
    averages out. `position` has shape (n_period, n_sample, n_axis); one period alone cannot tell: zeros.
    """
    if len(position) < 2:
        return np.zeros(position.shape[-1])
    steps = np.abs(np.diff(position, axis=0).mean(axis=1))
    largest: FloatArray = steps.max(axis=0)
    return largest


def unsaturated_share(saturated: float) -> float:
    """Amplitude, relative to the present one, at which the torque limit should be left alone.

    For a Gaussian torque that is beyond the limit for a share s of the time the limit is
    Phi^-1(1 - s / 2) standard deviations away; it should be UNSATURATED.
    """
    return float(np.clip(scipy.special.ndtri(1 - saturated / 2) / UNSATURATED, 0.1, 0.95))


def reject_saturated(
    label: str, saturated: FloatArray, axis_names: tuple[str, ...], limit: float
) -> list[str]:
    """Raise DataRejected where a torque was too often at its limit; return notes on what is merely notable.

    `saturated` is the share of samples at the limit, shape (n_axis,).
    """
    notes = []
    for name, share in zip(axis_names, saturated.tolist(), strict=True):
        text = f"D02: {label}: {name}: the torque is at its limit in {share:.2%} of the samples"
        if share > limit:
            raise DataRejected(
                f"{text}, more than {limit:.2%}; lower the amplitude of this axis to "
                f"{unsaturated_share(share):.2f} of the present one"
            )
        if share:
            notes.append(text)
    return notes


def reject_drift(
    label: str, position: FloatArray, axis_names: tuple[str, ...], limit_rad: float, has_lines: bool = True
) -> list[str]:
    """Raise DataRejected where a motor angle does not close from period to period (see `drift_per_period`).

    A motion without lines is not analysed by its periods: there it is a note, which is returned.
    """
    drift = drift_per_period(position)
    axis = int(np.argmax(drift))
    if drift[axis] <= limit_rad:
        return []
    text = (
        f"{label}: {axis_names[axis]}: the motor angle drifts by {drift[axis]:.3g} rad per period, more than "
        f"{limit_rad:.3g} rad"
    )
    if has_lines or not np.isfinite(drift[axis]):
        raise DataRejected(
            f"{text}, and what depends on the angle does not repeat; add settle_periods, or give the speed loop an "
            "integral gain"
        )
    return [f"{text}; the periods do not repeat"]


def check_axes(configurations: Configurations, excitation: Excitation, robot: Robot) -> None:
    """Raise ConfigurationError where the inputs were made for another robot than this one."""
    for what, names in {
        "configurations": configurations.axis_names,
        "excitation": excitation.axis_names,
    }.items():
        if names != robot.axis_names:
            raise ConfigurationError(
                f"the {what} are for the axes {', '.join(names)}, robot '{robot.name}' has "
                f"{', '.join(robot.axis_names)}; make them with this robot"
            )
    if not np.isclose(excitation.sample_time_s, robot.sample_time_s, rtol=1e-9):
        raise ConfigurationError(
            f"the excitation is sampled at {excitation.sample_time_s:g} s, the drives of robot '{robot.name}' at "
            f"{robot.sample_time_s:g} s; make it for this robot"
        )


def name_in_words(drives: type[Drives]) -> str:
    """Return what drives are called, of the name of their class: `simulated drives`."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", drives.__name__).lower()


class DriveAcquisition(Acquisition):
    """Measure through the drives: each reference runs some periods to settle, then the traced ones.

    Example
    -------
    ::

        acquire: {use: acquisition.drives, with: {periods: 2, settle_periods: 1}}
    """

    periods: int = Field(default=2, gt=0, le=MOST_PERIODS)
    """Periods of the reference that are kept."""
    settle_periods: int = Field(default=1, ge=0, le=MOST_PERIODS)
    """Periods before them, in which the transient dies out."""
    saturation_limit: float = Field(default=0.01, ge=0, lt=1)
    """Share of samples at the torque limit above which the data are rejected."""
    drift_limit_rad: PositiveFloat = 0.05
    """Drift of a motor angle from period to period above which data with lines are rejected, rad at the motor."""
    raw_log: str | None = "mcap"
    """Format (`robid records`) of the raw log beside the record; null keeps none."""

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """Limits: what is not known is no permission to move."""
        return ("torque_limit", "speed_limit")

    def run(
        self,
        configurations: Configurations,
        excitation: Excitation,
        robot: Robot,
        drives: Drives,
        context: Context,
    ) -> Record:
        """Clear all motions, perform them one after another, and put the record together."""
        check_axes(configurations, excitation, robot)
        n_block, n_exp, n_sample = excitation.reference.shape[1:4]
        seeds = context.generator.integers(2**62, size=(configurations.n_config, n_block, n_exp))
        experiments = plan_experiments(
            configurations, excitation, robot, self.periods + self.settle_periods, self.periods, seeds
        )
        plan = RecordPlan(
            axis_names=robot.axis_names,
            source=name_in_words(type(drives)),
            sample_time_s=excitation.sample_time_s,
            n_block=n_block,
            n_exp=n_exp,
            n_period=self.periods,
            n_sample=n_sample,
            angle=configurations.angle,
            line=excitation.line,
        )
        traces: dict[ExperimentIndex, Trace] = {}
        with self._raw_log(context, robot, plan) as log:
            session = Session(robot, context.log, log, lambda text: context.log.info("%s", text))
            try:
                with drives.open(session) as motors:
                    for place, experiment in experiments.items():
                        context.progress(len(traces), len(experiments), experiment.label)
                        trace = motors.perform(experiment)
                        if log is not None:
                            log.trace(place, experiment.label, trace)
                        self._judge(
                            experiment.label, trace, robot.axis_names, len(excitation.line) > 0, context
                        )
                        traces[place] = trace
            except MotionAborted as error:
                kept = " in the raw log" if log is not None else " nowhere: there is no raw log"
                raise type(error)(  # StopNotConfirmed stays one
                    f"{error}; {len(traces)} of {len(experiments)} experiments are kept{kept}"
                ) from error
        context.progress(len(traces), len(experiments), "all experiments are done")
        return assemble_record(plan, traces)

    def _judge(
        self, label: str, trace: Trace, axis_names: tuple[str, ...], has_lines: bool, context: Context
    ) -> None:
        notes = reject_saturated(label, trace.saturated, axis_names, self.saturation_limit)
        notes += reject_drift(label, trace.position, axis_names, self.drift_limit_rad, has_lines)
        for note in notes:
            context.log.warning("%s", note)

    @contextmanager
    def _raw_log(self, context: Context, robot: Robot, plan: RecordPlan) -> Iterator[RawLog | None]:
        """Open the raw log where the run lends a folder; it is complete where nothing went wrong."""
        if context.scratch is None or self.raw_log is None:
            yield None
            return
        stage = context.log.name.rpartition(".")[2]
        records = load_plugin("robid.records", self.raw_log)
        if not hasattr(records, "create"):
            raise ConfigurationError(f"raw_log: the format '{self.raw_log}' is for reading only; use mcap")
        log: RawLog = records.create(context.scratch / f"{stage}.{self.raw_log}")
        complete = False
        try:
            log.attach("robot.yaml", "application/yaml", robot.to_yaml().encode())
            log.plan(plan)
            yield log
            complete = True
        finally:
            log.close(complete)
