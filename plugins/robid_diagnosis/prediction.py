"""How well a model predicts a record that was not used: torque in open loop, speed in closed loop, axis by axis.

In open loop the motors move as recorded and the model says what torque that takes: nothing corrects what it gets wrong.
In closed loop the model moves by itself under the recorded reference: what a user of a simulation sees. Each axis has
its error in its unit and as a share of what was measured, with an interval; of two models, what the second gains.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
import scipy
from pydantic import NonNegativeFloat, PositiveFloat

from robid_core import (
    BoolArray,
    Context,
    DataRejected,
    DenseRun,
    Diagnosis,
    DiagnosisStage,
    Fit,
    FloatArray,
    PredictionErrors,
    Record,
    Robot,
    TimeComparison,
    simulate_record,
)
from robid_core.residual import prescribe_record
from robid_diagnosis.closed_loop import identified, relative_error
from robid_diagnosis.intervals import intervals, relative_errors, sums_of_blocks
from robid_diagnosis.wording import errors_line

REFERENCES = ("position_reference", "speed_reference")
STILL = 1e-3  # of travel at the joint, rad or m: an axis that goes less hardly moves
ORDER = 4  # of the low-pass, forwards and backwards
TOLD, FITTED, EXTENDED = "robot file", "fit", "extended robot"
OPEN, CLOSED = "torque in open loop", "speed in closed loop"


class Prediction(DiagnosisStage):
    """Predicts a record with the robot file's model and, where there are, with that of a fit and of a diagnosis.

    Of a record that has experiments of the role `test` it takes those; else give it one that the fit did not see::

        check:
          use: diagnosis.prediction
          inputs: {record: other, fit: fit}
    """

    highest_hz: PositiveFloat = 100.0
    """Errors above are left out: there noise is larger than what a model can tell."""
    skip_s: NonNegativeFloat = 0.5
    """Time at both ends of each experiment that is not compared."""
    block_s: PositiveFloat = 1.0
    """Length of the blocks that are drawn for intervals: errors further apart should be independent."""
    closed_loop: bool | None = None
    """Whether to simulate the closed loop, too; null: where a reference was recorded."""
    start: Literal["rest", "motion"] = "motion"
    """How experiments begin in closed loop."""

    def run(
        self,
        record: Record,
        robot: Robot,
        context: Context,
        fit: Fit | None = None,
        explained: Diagnosis | None = None,
    ) -> Diagnosis:
        """Predict and compare."""
        record, seen = _held_out(record)
        models = {TOLD: robot} | ({FITTED: identified(robot, fit)} if fit is not None else {})
        if explained is not None and explained.model is not None:
            models[EXTENDED] = Robot.of_model(explained.model)
        asked = any(name in run.channels for run in record.runs for name in REFERENCES)
        closed = asked if self.closed_loop is None else self.closed_loop
        n_step, torques, speeds = len(models) * (1 + closed), [], []
        for number, (name, model) in enumerate(models.items()):
            context.progress(number, n_step, f"torque of the recorded motion, {name}")
            torques.append(self._torque(prescribe_record(model, record)))
        for number, (name, model) in enumerate(models.items() if closed else ()):
            context.progress(len(models) + number, n_step, f"closed loop, {name}")
            speeds.append(self._speed(simulate_record(model, record, self.start)))
        context.progress(n_step, n_step)
        force, unit = (record.runs[0].channel(c).unit_symbol for c in ("motor_torque", "motor_position"))
        torque, speed = self._torque(record), self._speed(record)
        travels = [np.ptp(robot.joint_angle(run.lanes("motor_position")), axis=1) for run in record.runs]
        still = np.concatenate(travels).max(axis=0) < STILL
        errors, verdict = [], []
        for quantity, symbol, measured, predicted in (
            (OPEN, force, torque, torques),
            (CLOSED, f"{unit}/s", speed, speeds),
        ):
            if predicted:
                rows, gain = self._compared(quantity, symbol, measured, dict(zip(models, predicted, strict=True)),
                                            still, record, context)  # fmt: skip
                errors += rows
                verdict.append(errors_line(rows, gain))
        if seen and len(models) > 1:
            verdict.append(
                "The record has no experiments of the role test: if the fit saw it, this is no prediction."
            )
        return Diagnosis(
            method="prediction of a record",
            verdict=" ".join(verdict),
            time=(self._pictured(record, force, torque, torques[-1]),),
            errors=tuple(errors),
        )

    # Signals of each run of a record, filtered, its ends cut off, (n_lane, n_sample, n_axis) each

    def _torque(self, record: Record) -> list[FloatArray]:
        return [self._filtered(run, run.lanes("motor_torque")) for run in record.runs]

    def _speed(self, record: Record) -> list[FloatArray]:
        return [
            self._filtered(run, np.gradient(run.lanes("motor_position"), run.sample_time_s, axis=1))
            for run in record.runs
        ]

    def _filtered(self, run: DenseRun, values: FloatArray) -> FloatArray:
        highest, cut = min(self.highest_hz, 0.45 / run.sample_time_s), round(self.skip_s / run.sample_time_s)
        n_sample = values.shape[1]
        if n_sample - 2 * cut < 2:
            raise DataRejected(
                f"diagnosis.prediction: of an experiment of {n_sample * run.sample_time_s:g} s nothing is left when "
                f"skip_s = {self.skip_s:g} s is cut off at both ends; choose less"
            )
        low_pass = scipy.signal.butter(ORDER, highest, fs=1 / run.sample_time_s, output="sos")
        smooth: FloatArray = scipy.signal.sosfiltfilt(low_pass, values, axis=1)
        return smooth[:, cut : n_sample - cut]

    # Comparison

    def _compared(
        self,
        quantity: str,
        unit: str,
        measured: Sequence[FloatArray],
        predicted: Mapping[str, Sequence[FloatArray]],
        still: BoolArray,
        record: Record,
        context: Context,
    ) -> tuple[list[PredictionErrors], FloatArray]:
        """Errors of each model in one quantity, and the interval of what the last gains on the first."""
        lengths = [max(1, round(self.block_s / run.sample_time_s)) for run in record.runs]

        def sums(parts: Iterable[FloatArray]) -> FloatArray:
            return np.concatenate([sums_of_blocks(x, n) for x, n in zip(parts, lengths, strict=True)])

        power, n_value = sums(measured), sum(part.shape[0] * part.shape[1] for part in measured)
        error = np.stack(
            [sums(p - m for p, m in zip(parts, measured, strict=True)) for parts in predicted.values()]
        )
        found = intervals(error, power, context.generator)
        relative = relative_errors(error.sum(axis=1), power.sum(axis=0))
        rows = [
            PredictionErrors(
                model=name,
                quantity=quantity,
                unit_symbol=unit,
                axis_names=record.axis_names,
                rms=np.sqrt(error[m].sum(axis=0) / n_value),
                relative=relative[m],
                low=found.relative[0, m],
                high=found.relative[1, m],
                still=still,
            )
            for m, name in enumerate(predicted)
        ]
        return rows, found.gain

    def _pictured(
        self, record: Record, unit: str, measured: list[FloatArray], predicted: list[FloatArray]
    ) -> TimeComparison:
        """Torques over time for the page."""
        times, elapsed = [], 0.0
        for run, part in zip(record.runs, measured, strict=True):
            first, length = self.skip_s, run.n_period * len(run.time_s) * run.sample_time_s
            for _ in range(len(part)):
                times.append(elapsed + first + run.sample_time_s * np.arange(part.shape[1]))
                elapsed += length
        theirs, ours = np.concatenate(_flat(measured)), np.concatenate(_flat(predicted))
        return TimeComparison(
            axis_names=record.axis_names,
            channel="motor_torque",
            unit_symbol=unit,
            relative_error=relative_error(theirs, ours),
            time_s=np.concatenate(times),
            measured=theirs,
            modelled=ours,
        )


def _held_out(record: Record) -> tuple[Record, bool]:
    """Return the test experiments of a record; all, and true, where it has none."""
    if any(run.test is not None and run.test.any() for run in record.runs):
        assert record.run.test is not None
        return record.part(record.run.test), False
    return record, True


def _flat(parts: Sequence[FloatArray]) -> list[FloatArray]:
    """Lanes of each run one after another, shape (n_value, n_axis) each."""
    return [part.reshape(-1, part.shape[-1]) for part in parts]
