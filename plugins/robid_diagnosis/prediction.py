"""How well a model predicts a record that was not used: torque in open loop, speed in closed loop, axis by axis.

In open loop the motors move as recorded and the model says what torque that takes: nothing corrects what it gets wrong.
In closed loop the model moves by itself under the recorded reference: what a user of a simulation sees. Each axis has
its error in its unit and as a share of what was measured, with an interval; of two models, what the second gains.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from robid_core import (
    AxisKey,
    Context,
    Diagnosis,
    DiagnosisStage,
    Fit,
    FloatArray,
    Record,
    Robot,
    TimeComparison,
    simulate_record,
)
from robid_core.residual import prescribe_record
from robid_diagnosis.closed_loop import identified, relative_error
from robid_diagnosis.comparison import (
    EXTENDED,
    TOLD,
    Comparison,
    errors_of_models,
    has_references,
    still_axes,
)
from robid_diagnosis.wording import errors_line

FITTED = "fit"
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
    """Whether to simulate the closed loop, too; null: where a reference was recorded and the robot file tells the
    controllers."""
    start: Literal["rest", "motion"] = "motion"
    """How experiments begin in closed loop."""

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """What a closed loop takes, where it is asked for; else it is left out where the file lacks it."""
        return ("torque_limit", "controller") if self.closed_loop else ()

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
        missing = robot.left_out(("torque_limit", "controller")) if has_references([record]) else ""
        closed = has_references([record]) and not missing if self.closed_loop is None else self.closed_loop
        comparison = Comparison("diagnosis.prediction", self.highest_hz, self.skip_s, self.block_s)
        n_step, torques, speeds = len(models) * (1 + closed), [], []
        for number, (name, model) in enumerate(models.items()):
            context.progress(number, n_step, f"torque of the recorded motion, {name}")
            torques.append(comparison.torque(prescribe_record(model, record)))
        for number, (name, model) in enumerate(models.items() if closed else ()):
            context.progress(len(models) + number, n_step, f"closed loop, {name}")
            speeds.append(comparison.speed(simulate_record(model, record, self.start)))
        context.progress(n_step, n_step)
        force, unit = (record.runs[0].channel(c).unit_symbol for c in ("motor_torque", "motor_position"))
        torque, still = comparison.torque(record), still_axes(robot, [record])
        errors, verdict = [], []
        for quantity, symbol, measured, predicted in (
            (OPEN, force, torque, torques),
            (CLOSED, f"{unit}/s", comparison.speed(record), speeds),
        ):
            if predicted:
                by_model = dict(zip(models, predicted, strict=True))
                sums = comparison.sums([record], measured, by_model)
                rows, gain = errors_of_models(quantity, symbol, *sums, record, still, context.generator)
                errors += rows
                verdict.append(errors_line(rows, gain))
        if missing:
            verdict.append(f"The closed loop was not simulated: {missing}.")
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
