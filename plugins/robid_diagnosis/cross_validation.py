"""How well an explained robot predicts what it was not fitted to: block after block of a recording is left out.

The causes are those that a diagnosis found in all of it; their numbers, shapes among them, and everything else that the
robot has are fitted anew to the other blocks. The torque that this robot takes for the motion of the block left out is
held against the measured one. Errors of all blocks together over all torques, beside the same for the robot file with
its values refitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from robid_core import (
    ConfigurationError,
    Context,
    DataRejected,
    Diagnosis,
    DiagnosisStage,
    FloatArray,
    Record,
    Robot,
    TimeComparison,
)
from robid_core.estimation.rigid.regression import decimate, decimated_index
from robid_core.residual import prescribe_record, variant_robots
from robid_diagnosis.closed_loop import relative_error
from robid_diagnosis.comparison import EXTENDED, REFITTED, errors_of_models, still_axes
from robid_diagnosis.hypothesis import Addition, Case, Hypothesis
from robid_diagnosis.parts import cut_into_parts
from robid_diagnosis.results import model_of
from robid_diagnosis.timing import delayed
from robid_diagnosis.wording import errors_line

DRAWN = 24  # pieces at least that are drawn again for intervals
QUANTITY = "torque of blocks left out of the fit"


class CrossValidation(DiagnosisStage):
    """Leaves out one block of a recording after the other, fits all values to the rest and predicts the block's torque.

    Example::

        validate: {use: diagnosis.cross_validation, with: {blocks: 10, decimation: 10}}
    """

    blocks: Annotated[int, Field(ge=2, le=100)] = 10
    """Blocks into which the recording is cut."""
    skip_s: NonNegativeFloat = 0.0
    """Left out at its beginning."""
    decimation: PositiveInt = 1
    """Measured and predicted torque go through one low-pass, forwards and backwards, and every such sample is kept."""
    highest_hz: PositiveFloat = 100.0
    """Bins above are left out of the fits."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations of parameters of the robot file by pattern, in natural scales (0.01: one percent)."""
    model_error: PositiveFloat = 2e-4
    """Relative error of the model's torque per bin and axis, beside the noise."""
    passes: PositiveInt = 3
    """Prescribed motions of each fit, which begins where that to all blocks ended."""

    constants: dict[str, str] = {}
    """Constants of the record that are parameters of the robot, `{payload_kg: effect.load.mass}`."""

    def run(self, record: Record, robot: Robot, context: Context, explained: Diagnosis) -> Diagnosis:
        """Fit, predict and compare, for the robot file and for the extended robot."""
        if explained.model is None:
            raise ConfigurationError("diagnosis.cross_validation: the diagnosis before it has no robot")
        if record.run.valid[..., 0].size > 1:
            raise DataRejected(
                f"diagnosis.cross_validation: {record.run.valid[..., 0].size} experiments or periods; it cuts one long "
                "motion into blocks; of several experiments diagnosis.effects leaves configurations out"
            )
        robot, _ = variant_robots((record,), robot, {}, self.constants)
        extended, _ = variant_robots((record,), Robot.of_model(explained.model), {}, self.constants)
        additions = _additions(robot, extended, explained)
        bare = extended.without_effect(*(one.label for one in additions))
        models = {
            REFITTED: (bare, Hypothesis()),
            EXTENDED: (bare, Hypothesis(additions)),
        }
        measured, predicted = self._decimated(record, record.run.lanes("motor_torque")[0]), []
        for number, (told, hypothesis) in enumerate(models.values()):
            parts = np.array_split(np.arange(len(measured)), self.blocks)
            torque = np.empty_like(measured)
            for k, (part, whole) in enumerate(
                zip(parts, self._left_out(record, told, hypothesis), strict=True)
            ):
                context.progress(
                    number * self.blocks + k, len(models) * self.blocks, "predicting a block left out"
                )
                torque[part] = self._decimated(record, whole)[part]
            predicted.append(torque)
        return self._compared(record, robot, measured, dict(zip(models, predicted, strict=True)), context)

    def _left_out(self, record: Record, told: Robot, hypothesis: Hypothesis) -> Iterator[FloatArray]:
        """Torques of the whole recording as predicted without each block in turn, (n_sample, n_axis)."""
        cut = cut_into_parts(record, self.blocks, self.skip_s)
        width = told.drives.friction_speed

        def case(part: Record) -> Case:
            settings = self.highest_hz, 0, self.passes, self.model_error
            return Case((part,), told, self.prior, *settings, friction_speed=width)

        every, silent = np.ones(cut.run.valid.shape[:3], dtype=bool), lambda *_: None
        begin = case(cut).fit_what_is_seen(hypothesis, silent, as_told=True)
        for k in range(self.blocks):
            kept = every.copy()
            kept[0, 0, k] = False
            own = case(cut.part(kept))
            fitted = own.fit_what_is_seen(begin.hypothesis, silent, begin, roughly=True)
            model = Robot.of_model(model_of(told, fitted))
            torque = prescribe_record(model, record).run.lanes("motor_torque")[0]
            late = fitted.problem.delay(fitted.point) / record.run.sample_time_s
            yield delayed(torque[None], late)[0]

    def _decimated(self, record: Record, torque: FloatArray) -> FloatArray:
        return decimate(torque[round(self.skip_s / record.run.sample_time_s) :], self.decimation)

    def _instants(self, record: Record) -> FloatArray:
        """When the samples that are kept were taken, s."""
        time = record.run.time_s[round(self.skip_s / record.run.sample_time_s) :]
        kept: FloatArray = time if self.decimation == 1 else time[decimated_index(len(time), self.decimation)]
        return kept

    def _compared(
        self,
        record: Record,
        robot: Robot,
        measured: FloatArray,
        predicted: dict[str, FloatArray],
        context: Context,
    ) -> Diagnosis:
        pieces = np.array_split(np.arange(len(measured)), max(self.blocks, DRAWN))

        def sums(values: FloatArray) -> FloatArray:
            return np.stack([(values[piece] ** 2).sum(axis=0) for piece in pieces])

        unit = record.run.channel("motor_torque").unit_symbol
        error = {name: sums(measured - one) for name, one in predicted.items()}
        still = still_axes(robot, [record])
        errors, gain = errors_of_models(
            QUANTITY, unit, error, sums(measured), len(measured), record, still, context.generator
        )
        best = predicted[EXTENDED]
        return Diagnosis(
            method=f"cross-validation over {self.blocks} blocks",
            verdict=errors_line(errors, gain),
            errors=tuple(errors),
            time=(
                TimeComparison(
                    axis_names=record.axis_names,
                    channel="motor_torque",
                    unit_symbol=unit,
                    relative_error=relative_error(measured, best),
                    time_s=self._instants(record),
                    measured=measured,
                    modelled=best,
                ),
            ),
        )


def _additions(robot: Robot, extended: Robot, explained: Diagnosis) -> tuple[Addition, ...]:
    """Effects that a diagnosis added to a robot, with what it estimated of them."""
    known = explained.values.names if explained.values is not None else ()
    found = []
    for label, entry in extended.description.effects.items():
        if label in robot.description.effects:
            continue
        head = f"effect.{label}."
        values = {
            name.removeprefix(head): extended.parameter(name)
            for name in extended.layout
            if name.startswith(head)
        }
        free = tuple(name.removeprefix(head) for name in known if name.startswith(head))
        found.append(Addition(label, entry.use, entry.on, entry.side, values, free))
    return tuple(found)
