"""How well a model predicts runs that were not used: torque in open loop, speed or angle in closed loop, by axis.

In open loop the motors move as recorded and the model says what torque that takes: nothing corrects what it gets wrong.
In closed loop the model moves by itself under the recorded reference: what a user of a simulation sees. Servos that set
a voltage report no torque: then the angle in closed loop is what is compared. Each axis has its error in its unit and
as a share of what was measured, with an interval; of two models, what the second gains. Runs that a fit was made from
are predicted, too, and stand beside those that were held out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from robid_core import (
    AxisKey,
    ConfigurationError,
    Context,
    DataRejected,
    Diagnosis,
    DiagnosisStage,
    Doubt,
    Fit,
    FloatArray,
    PredictionErrors,
    Record,
    Robot,
    RobotName,
    TimeComparison,
    Timing,
    simulate_record,
)
from robid_core.estimation.sample_marks import have_been_seen
from robid_core.residual import (
    check_variants,
    excited_range,
    prescribe_record,
    variant_robots,
    whole_pieces,
    words_of_pieces,
)
from robid_diagnosis.closed_loop import identified, relative_error
from robid_diagnosis.comparison import (
    EXTENDED,
    TOLD,
    Comparison,
    Signals,
    errors_of_models,
    has_references,
    still_axes,
)
from robid_diagnosis.extrapolation import extrapolation_doubt
from robid_diagnosis.prediction_curves import prediction_curves
from robid_diagnosis.prediction_noise import noise_left
from robid_diagnosis.prediction_runs import Piece, pieces_of, predicted_runs, rests_lines, run_errors
from robid_diagnosis.timing import delayed, late_axes
from robid_diagnosis.wording import errors_line

FITTED = "fit"
OPEN, CLOSED, ANGLE = "torque in open loop", "speed in closed loop", "angle in closed loop"


class Prediction(DiagnosisStage):
    """Predicts records with the robot file's model, and with the models of a fit and of a diagnosis where given.

    Experiments of the role `test` are judged, where there are any, and those of the fit shown beside them; else give
    it records that the fit did not see::

        check:
          use: diagnosis.prediction
          inputs: {record: [other, another], fit: fit}
    """

    highest_hz: PositiveFloat = 100.0
    """Errors above are left out: there noise is larger than what a model can predict."""
    skip_s: NonNegativeFloat = 0.5
    """Time at both ends of each experiment that is not compared."""
    block_s: PositiveFloat = 1.0
    """Length of the blocks that are drawn for intervals: errors further apart should be independent."""
    closed_loop: bool | None = None
    """Whether to simulate the closed loop, too; null: where a reference was recorded and the robot file gives the
    controllers."""
    start: Literal["rest", "motion"] = "motion"
    """How experiments begin in closed loop."""
    horizon_s: PositiveFloat | None = None
    """The closed loop begins anew from the measured state that often, as in `fit.time_domain`; null: never."""
    robots: dict[str, RobotName] = {}
    """Robots under which variants were measured, where they are not the nominal one: `{loaded: arm.yaml}`."""
    constants: dict[str, str] = {}
    """Constants of the records that are parameters of the robot, `{payload_kg: effect.load.mass}`: each variant's robot
    has the value of its experiments, and needs no file under `robots`."""

    handles_variants: ClassVar[bool] = True

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """What a closed loop takes, where it is asked for; else it is left out where the file lacks it."""
        return ("torque_limit", "controller") if self.closed_loop else ()

    def run(
        self,
        record: tuple[Record, ...],
        robot: Robot,
        context: Context,
        fit: Fit | None = None,
        explained: Diagnosis | None = None,
    ) -> Diagnosis:
        """Predict and compare."""
        filed, (_, files) = robot, variant_robots(record, robot, self.robots, {})
        robot, others = variant_robots(record, robot, self.robots, self.constants)
        check_variants(record, robot, others, ())
        if files and explained is not None and explained.model is not None:
            raise ConfigurationError(
                "robots: the robot of a diagnosis is one robot; give what variants carry as constants of the record "
                "(constants: {payload_kg: effect.load.mass}), or predict one variant"
            )
        pieces, marked = pieces_of(record, self._whole)
        if words := words_of_pieces(record, [piece.record for piece in pieces]):
            context.log.warning("diagnosis.prediction %s", words)
        variants = dict.fromkeys(piece.variant for piece in pieces)
        models = {
            one: self._models(filed, files.get(one), others.get(one, robot), fit, explained)
            for one in variants
        }
        names = tuple(models[pieces[0].variant])
        missing = robot.left_out(("torque_limit", "controller")) if has_references(record) else ""
        closed = has_references(record) and not missing if self.closed_loop is None else self.closed_loop
        open_loop = all("motor_torque" in run.channels for one in record for run in one.runs)
        if not (open_loop or closed):
            raise DataRejected(
                "diagnosis.prediction: no torque was recorded, so that only the closed loop can be predicted, and "
                f"{missing or 'the record has no reference; map the channel that the controller followed'}"
            )
        comparison = Comparison("diagnosis.prediction", self.highest_hz, self.skip_s, self.block_s)
        unit = record[0].runs[0].channel("motor_position").unit_symbol
        force = record[0].runs[0].channel("motor_torque").unit_symbol if open_loop else ""
        quantities = {OPEN: force} if open_loop else {}
        quantities |= ({CLOSED: f"{unit}/s"} if open_loop else {ANGLE: unit}) if closed else {}
        lags = explained.timing if explained is not None else None
        signals, done = dict[str, dict[str, list[FloatArray]]](), 0
        for quantity in quantities:
            signals[quantity] = {name: [] for name in names}
            for name, found in signals[quantity].items():
                context.progress(done, len(quantities) * len(names), f"{quantity}, {name}")
                done += 1
                for piece in pieces:
                    made = self._predicted(quantity, models[piece.variant][name], piece.record)
                    if name == EXTENDED and quantity == OPEN:
                        made = _late(made, lags)
                    found += _compared(comparison, quantity, made)
        context.progress(done, done)
        measured = {
            quantity: [one for piece in pieces for one in _compared(comparison, quantity, piece.record)]
            for quantity in quantities
        }
        errors, verdict, runs = list[PredictionErrors](), list[str](), []
        for quantity, symbol in quantities.items():
            rows, gain = self._errors(
                quantity, symbol, pieces, measured, signals, models, comparison, context
            )
            errors += rows
            last = predicted_runs(pieces, measured[quantity], signals[quantity][names[-1]], self.skip_s)
            verdict.append(errors_line(rows, gain))
            if quantity == OPEN:
                verdict += rests_lines(last, robot.axis_names, names[-1])
            runs.append((quantity, symbol, last))
        if lags is not None and open_loop and (late := late_axes(lags)):
            verdict.append(f"The torque of the extended robot is as late as the diagnosis found it: {late}.")
        if missing:
            verdict.append(f"The closed loop was not simulated: {missing}.")
        if not marked and len(names) > 1:
            verdict.append(_words_of_seen(record, fit if explained is None else None))
        first, symbol, last = runs[0]
        return Diagnosis(
            method="prediction of a record",
            verdict=" ".join(verdict),
            time=(self._pictured(pieces, first, symbol, measured[first], signals[first][names[-1]]),),
            errors=tuple(errors),
            runs=tuple(run_errors(names[-1], q, u, robot.axis_names, own) for q, u, own in runs),
            curves=prediction_curves(last, robot, first.partition(" ")[0], symbol),
            doubts=tuple(self._beyond(pieces, fit)),
        )

    def _whole(self, records: Sequence[Record]) -> tuple[Record, ...]:
        """Return records without gaps; of those that have some, the pieces between of which a block is compared."""
        shortest_s = 2 * self.skip_s + self.block_s
        return whole_pieces(records, shortest_s, "diagnosis.prediction", "lower skip_s and block_s")

    def _models(
        self, filed: Robot, own: Robot | None, told: Robot, fit: Fit | None, explained: Diagnosis | None
    ) -> Mapping[str, Robot]:
        """Robots of one variant by the names of the models: as its file has it, and with the constants of its runs."""
        numbers = {name: told.parameter(name) for name in self.constants.values()}
        models = {TOLD: told}
        if fit is not None:
            found = identified(filed, fit)
            models[FITTED] = (found if own is None else _shared(filed, own, found, fit)).with_parameters(
                numbers
            )
        if explained is not None and explained.model is not None:
            models[EXTENDED] = Robot.of_model(explained.model).with_parameters(numbers)
        return models

    def _predicted(self, quantity: str, model: Robot, record: Record) -> Record:
        if quantity == OPEN:
            return prescribe_record(model, record)
        return simulate_record(model, record, self.start, horizon_s=self.horizon_s)

    def _errors(
        self,
        quantity: str,
        unit: str,
        pieces: Sequence[Piece],
        measured: Mapping[str, Signals],
        signals: Mapping[str, Mapping[str, Signals]],
        models: Mapping[str, Mapping[str, Robot]],
        comparison: Comparison,
        context: Context,
    ) -> tuple[list[PredictionErrors], FloatArray]:
        """Of the judged experiments, over the torque limit, too, where the robot file tells it."""
        judged, robot = [piece for piece in pieces if piece.tested], models[pieces[0].variant][TOLD]
        kept = [piece.tested for piece in pieces for _ in piece.record.runs]

        def of_judged(values: Signals) -> list[FloatArray]:
            return [one for one, keep in zip(values, kept, strict=True) if keep]

        records = [piece.record for piece in judged]
        theirs = of_judged(measured[quantity])
        ours = {name: of_judged(values) for name, values in signals[quantity].items()}
        sums = comparison.sums(records, theirs, ours)
        still = still_axes(robot, records)
        last = {variant: list(found.values())[-1] for variant, found in models.items()}
        noise = None
        if quantity == OPEN:
            (own,) = context.generator.spawn(1)
            noise = noise_left(judged, last, list(ours.values())[-1], comparison, own)
        rows, gain = errors_of_models(quantity, unit, *sums, records[0], still, context.generator, noise)
        if quantity == OPEN:
            limit = robot.drives.torque_limit_or(np.full(robot.n_axis, np.nan))
            rows = [row.replace(of_limit=row.rms / limit) for row in rows]
        return rows, gain

    def _beyond(self, pieces: Sequence[Piece], fit: Fit | None) -> Iterator[Doubt]:
        """Doubt a prediction that goes beyond the motion that the fit saw, or the other experiments show."""
        seen = [piece.record for piece in pieces if not piece.tested]
        trained = fit.excited if fit is not None else None
        if trained is None and seen:
            trained = excited_range(seen)
        asked = excited_range([piece.record for piece in pieces if piece.tested])
        if trained is not None and asked is not None:
            yield from extrapolation_doubt(trained, asked)

    def _pictured(
        self, pieces: Sequence[Piece], quantity: str, unit: str, measured: Signals, predicted: Signals
    ) -> TimeComparison:
        """Judged signals over time for the page."""
        times, theirs, ours, elapsed = list[FloatArray](), list[FloatArray](), list[FloatArray](), 0.0
        runs = [(piece.tested, run) for piece in pieces for run in piece.record.runs]
        for (tested, run), there, here in zip(runs, measured, predicted, strict=True):
            if not tested:
                continue
            length = run.n_period * len(run.time_s) * run.sample_time_s
            for lane, own in zip(there, here, strict=True):
                times.append(
                    elapsed + self.skip_s + run.sample_time_s * np.arange(len(lane), dtype=np.float64)
                )
                theirs.append(lane)
                ours.append(own)
                elapsed += length
        whole = np.concatenate(theirs), np.concatenate(ours)
        return TimeComparison(
            axis_names=pieces[0].record.axis_names,
            channel="motor_torque" if quantity == OPEN else "motor_position",
            unit_symbol=unit,
            relative_error=relative_error(*whole),
            time_s=np.concatenate(times),
            measured=whole[0],
            modelled=whole[1],
        )


def _shared(nominal: Robot, own: Robot, fitted: Robot, fit: Fit) -> Robot:
    """Return the robot of a variant with the fitted values of what it shares with the nominal robot."""
    if fitted.description.effects.keys() - nominal.description.effects.keys():
        raise ConfigurationError(
            "robots: the fit added effects to the nominal robot, which files of other variants lack; give what "
            "differs between variants as constants of the record"
        )
    names = fit.model.names if fit.model is not None else fit.free_names
    alike = [n for n in names if n in own.layout and own.parameter(n) == nominal.parameter(n)]
    return own.with_parameters({name: fitted.parameter(name) for name in alike})


def _words_of_seen(records: Sequence[Record], fit: Fit | None) -> str:
    """Say whether a fit saw records that are held out by nobody."""
    marks = fit.excited.marks if fit is not None and fit.excited is not None else None
    seen = None if marks is None else have_been_seen(records, marks)
    if seen is None:
        return "The record has no experiments of the role test: if the fit saw it, this is no prediction."
    if seen:
        return "The fit saw this record: how well it is fitted, and no prediction."
    return "The fit did not see this record."


def _late(record: Record, timing: Timing | None) -> Record:
    """Return a predicted record with its torques as late as recorded ones were found to be."""
    if timing is None:
        return record
    runs = []
    for run in record.runs:
        channel, lag = run.channel("motor_torque"), timing.lag * timing.sample_time_s / run.sample_time_s
        values = delayed(run.lanes("motor_torque"), lag).reshape(channel.values.shape)
        runs.append(run.replace(channels={**run.channels, "motor_torque": channel.replace(values=values)}))
    return record.replace(runs=tuple(runs))


def _compared(comparison: Comparison, quantity: str, record: Record) -> list[FloatArray]:
    """What of a record is compared, of each run, (n_lane, n_sample, n_axis)."""
    if quantity == OPEN:
        return comparison.torque(record)
    return comparison.speed(record) if quantity == CLOSED else comparison.angle(record)
