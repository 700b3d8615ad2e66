"""Recordings made elsewhere as one record: files that a `robid.records` reader knows, and a channel map.

The files lie below the data root (`ROBID_DATA` or `--data`), are never written, and count by their SHA-256. Channels
come out in SI units with the sign of the robot's axes: `joint_...` on the joint side, `link_...` in the axes of a
sensor on the link, everything else at the motor shaft, whatever side of the gear the files state. One file holds one
experiment; a pattern of names, a table, or the times at which experiments begin in a long file say which experiments
many are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import PositiveFloat, model_validator

from robid_acquisition.arrangement import Arrangement, arrange, listed
from robid_acquisition.assembly import Assembly, Index, name_file
from robid_acquisition.before_run import channel_problems, period_problems
from robid_acquisition.data_file import advice, find_file, reader_name, reader_of, refuse_others
from robid_acquisition.first_file import file_problems
from robid_acquisition.lines_setting import Lines
from robid_acquisition.own_record import read_own_record
from robid_acquisition.periodicity import (
    clock_of_period,
    doubts_of_claimed_lines,
    doubts_of_claimed_period,
    found_lines,
    found_period,
    words_of_untold_period,
)
from robid_acquisition.pieces import pieces_between_holes
from robid_acquisition.poses import mean_angle, reach_about_mean, unlike_poses
from robid_acquisition.reading import ReadFiles, side_of
from robid_acquisition.record_checks import check_record
from robid_acquisition.recording import Recording
from robid_acquisition.samples import Samples
from robid_acquisition.signals import samples_per_period, split_periods
from robid_core import (
    BAG_READER,
    BoolArray,
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    FloatArray,
    IntArray,
    Record,
    RobidError,
    Robot,
    frozen,
)

Experiment = tuple[
    dict[str, FloatArray], BoolArray
]  # channels (n_period, n_sample, n_axis), known (n_period, n_sample)

MOVES = (
    5.0  # times the tolerance of poses: experiments without a period that go so far are moves, about no pose
)


WITHOUT_LINES = (
    "period_s is given and no lines: fits and diagnoses treat the motion as one that does not repeat; with lines: auto "
    "they use its single periods, whose differences show the noise (lines: []: it stays so)"
)


class RecordedAcquisition(ReadFiles):
    """Reads recordings through a channel map: one file, a pattern of files, or those that a table lists.

    Example::

        acquire:
          use: acquisition.recorded
          with:
            pattern: "lab/c{config}_b{block}_e{exp}.npz"
            sample_time_s: 0.0005
            period_s: 4.0
            lines: [17, 19, 21]
            torque_hold: zero_order_hold
            channels:
              motor_position: {column: q, unit: rad}
              motor_torque: {column: current, unit: A, torque_constant: 0.43, delay_s: 0.00025}
    """

    period_s: PositiveFloat | Literal["auto"] | None = None
    """Period of the excitation: whole periods are separated; auto: found in the first experiment; null: no period, and
    a recording that repeats is not reported."""
    lines: Lines = ()
    """Excited bins of one period, which frequency responses are made of; without them fits and diagnoses take the
    motion for one that does not repeat. auto: found in the spectra of the references, or torques."""
    torque_hold: Literal["zero_order_hold", "continuous"] | None = None
    """How torque goes between samples: held by a digital controller, or continuous (measured, filtered). To be said
    where lines are given: half a sample of phase costs percents of a stiffness."""
    plausibility: Literal["refuse", "warn", "ignore"] = "refuse"
    """What becomes of a record that fits the robot file only with a sign turned, in another unit, on the other side of
    the gear, or with axes exchanged: the message says which."""
    angle_tolerance: PositiveFloat = 0.01
    """Joint angle (rad, or m) by which the poses of one configuration may differ from their mean without a warning."""

    @model_validator(mode="after")
    def _settings_agree(self) -> RecordedAcquisition:
        if self.lines and self.period_s is None:
            raise ValueError("lines need period_s")
        if self.lines and self.torque_hold is None:
            raise ValueError(
                "torque_hold is missing, which lines go with: zero_order_hold where a digital controller holds the "
                "torque from sample to sample, continuous where it was measured or filtered"
            )
        held = self.channels["motor_torque"].held_s if "motor_torque" in self.channels else 0.0
        if held and self._held:
            raise ValueError(
                f"torque_hold: zero_order_hold says that a torque is held for a whole sample, held_s: {held:g} for "
                "less; with held_s, which counts the hold, state torque_hold: continuous"
            )
        return self

    @property
    def gives_lines(self) -> bool:
        """Whether the settings say, or a record of robid's own may."""
        return bool(self.lines) or not self.channels

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Say which channels cannot be the robot's, and which lines the period cannot have."""
        found = channel_problems(self.channels, robot.axis_names)
        step = self.sample_time_s
        return found if step is None else found | period_problems(self.period_s, self.lines, step)

    def problems_with_files(self, robot: Robot, data_root: Path) -> dict[tuple[str | int, ...], str]:
        """Say which columns the first file lacks, and which settings it is too short for."""
        return file_problems(self, self.period_s, self.lines, robot, data_root)

    def run(self, robot: Robot, context: Context) -> Record:
        """Find, read, convert and cut, one file after the other."""
        root, name = context.data_root, self.source_name
        if root is None:
            raise ConfigurationError(f"no data folder is set; {advice(name, self.origin)}")
        if self.path:
            find_file(root, self.path, self.origin)
        refuse_others(super().external_files(root), self.sha256, name, self.origin)
        names: dict[Index, str] = {}
        if not self.channels:
            record = read_own_record(reader_of(root, name, self.format), root / name, robot)
            if self.variant:
                record = record.replace(variants=(self.variant,) * len(record.angle))
        else:
            arrangement = arrange(self.recordings(root))
            self._tell(arrangement, context)
            record, names = self._record(arrangement, robot, context)
        edge_hz = self.filter.low_pass_hz if self.filter is not None and self.channels else None
        check_record(record, robot, context.log, self.plausibility, self.source_name, names, edge_hz)
        return _of_role(record, self.role) if self.role else record

    def _tell(self, arrangement: Arrangement, context: Context) -> None:
        """Warn of what is missing, or refuse."""
        if arrangement.shortfalls and self.incomplete == "refuse":
            raise DataRejected(f"{'. '.join(arrangement.shortfalls)}; add the files, or set incomplete: drop")
        for words in arrangement.shortfalls:
            context.log.warning("%s", words)

    def _record(
        self, arrangement: Arrangement, robot: Robot, context: Context
    ) -> tuple[Record, dict[Index, str]]:
        """Read every experiment and put the record together; with what each experiment is called."""
        splits = self.gaps == "split"
        period_s = None if self.period_s == "auto" else self.period_s
        assembly = Assembly(arrangement.shape, self.period_s is not None)
        samples: Samples | None = None
        scalars: dict[Index, Mapping[str, float]] = {}
        whole: dict[Index, Experiment] = {}
        rests: list[str] = []
        places = sorted(
            np.ndindex(*arrangement.shape), key=lambda place: _at(arrangement, place).file
        )  # each file once
        for place in context.track(places, len(places), "reading recordings"):
            recording = _at(arrangement, place)
            try:
                if samples is None or samples.file != recording.file:
                    samples = self.read(recording.file, robot, context)
                    for note in samples.notes:
                        moved = self._held and samples.resampled
                        held = "; its torque is no longer held from sample to sample" if moved else ""
                        context.log.warning("%s%s", note, held)
                if self.period_s == "auto" and period_s is None:
                    (values, known), _ = self._experiment(recording, samples, robot, None)
                    period_s = found_period(values, samples.sample_time_s)
                    context.log.info("%s repeats every %g s", recording.name, period_s)
                (values, known), rest = self._experiment(recording, samples, robot, period_s)
                if splits:
                    whole[place] = values, known
                else:
                    assembly.put(place, recording.name, values, samples.sample_time_s, known)
            except RobidError as error:
                if len(places) > 1:
                    name_file(recording.name, error)
                raise
            scalars[place] = samples.scalars
            if rest:
                rests.append(f"{rest} samples of {recording.name}")
        if rests:
            where = (
                "after the last whole period" if self.period_s is not None else "at ends that a delay took"
            )
            context.log.warning("A11: left out %s: %s", where, listed(rests))
        assert samples is not None
        if self.scalars:
            arrangement = _with_constants(arrangement, scalars)
        if splits:
            arrangement, assembly = self._split(arrangement, whole, samples.sample_time_s, context)
        if cut := assembly.cut():
            context.log.warning("A11: %s", cut)
        if n_masked := int((~assembly.known).sum()):
            context.log.warning("gaps: mask: %d of %d samples are masked", n_masked, assembly.known.size)
        angle = np.zeros((*arrangement.shape, robot.n_axis))
        for place in np.ndindex(*arrangement.shape):
            angle[place] = mean_angle({name: one[place] for name, one in assembly.channels.items()}, robot)
        reach = max(
            reach_about_mean({name: one[place] for name, one in assembly.channels.items()}, robot)
            for place in np.ndindex(*arrangement.shape)
        )
        moves = self.period_s is None and reach > MOVES * self.angle_tolerance
        unlike = unlike_poses(arrangement, angle, self.angle_tolerance, robot.axis_names)
        if unlike and not moves:
            context.log.warning("%s", unlike)
        lines = None
        if self.period_s is not None and assembly.known.all():
            for place, words in doubts_of_claimed_period(assembly.channels, assembly.sample_time_s):
                context.log.warning("%s: %s", _at(arrangement, place).name, words)
            lines = self._lines(assembly.channels, context)
        elif self.lines:
            if self.lines == "auto":
                raise DataRejected(
                    "lines: auto needs records without holes; give the lines, or set gaps: split"
                )
            lines = np.array(self.lines, dtype=np.int64)
        elif "period_s" not in self.model_fields_set and not splits and assembly.known.all():
            untold = words_of_untold_period(assembly.channels, assembly.sample_time_s)
            if untold is not None:
                context.log.warning("%s: %s", _at(arrangement, untold[0]).name, untold[1])
        names = arrangement.variants if any(arrangement.variants) else (self.variant,) * arrangement.shape[0]
        channels = {
            name: Channel(side_of(name), self.channels[name].symbol, frozen(values))
            for name, values in assembly.channels.items()
        }
        record = Record(
            axis_names=robot.axis_names,
            source=self._source(arrangement),
            torque_hold=self.torque_hold or "continuous",
            runs=(_dense_run(arrangement, channels, assembly.known, assembly.sample_time_s),),
            angle=angle.mean(axis=(1, 2)),
            line=lines,
            variants=names if any(names) else (),
        )
        return record, {place: _at(arrangement, place).name for place in np.ndindex(*arrangement.shape)}

    @property
    def _held(self) -> bool:
        return self.torque_hold == "zero_order_hold"

    def _lines(self, channels: Mapping[str, FloatArray], context: Context) -> IntArray | None:
        """Return the lines: those that are given, held against the spectra, or those that are found."""
        if not self.lines:
            several = next(iter(channels.values())).shape[3] > 1
            if several and "lines" not in self.model_fields_set:
                context.log.warning("%s", WITHOUT_LINES)
            return None
        if self.lines != "auto":
            lines = np.array(self.lines, dtype=np.int64)
            for words in doubts_of_claimed_lines(channels, lines):
                context.log.warning("%s", words)
            return lines
        lines, told = found_lines(channels)
        context.log.info("lines: auto: %s", told)
        return lines

    def _split(
        self,
        arrangement: Arrangement,
        whole: Mapping[Index, Experiment],
        sample_time_s: float,
        context: Context,
    ) -> tuple[Arrangement, Assembly]:
        """Make experiments of the pieces between holes."""
        periodic = self.period_s is not None
        marks: dict[Index, BoolArray] = {
            place: np.asarray(known.all(axis=1) if periodic else known[0])
            for place, (_, known) in whole.items()
        }
        n_sample = next(iter(whole.values()))[1].shape[1]
        arranged, pieces, words = pieces_between_holes(
            arrangement, marks, sample_time_s * n_sample if periodic else sample_time_s
        )
        if len(pieces) != len(whole) or any(one.length != len(marks[one.place]) for one in pieces.values()):
            context.log.warning("%s", words)
        assembly = Assembly(arranged.shape, periodic)
        for place, piece in pieces.items():
            kept = slice(piece.first, piece.first + piece.length)
            values, _ = whole[piece.place]
            cut = {name: one[kept] if periodic else one[:, kept] for name, one in values.items()}
            assembly.put(place, _at(arranged, place).name, cut, sample_time_s)
        return arranged, assembly

    def _experiment(
        self, recording: Recording, samples: Samples, robot: Robot, period_s: float | None
    ) -> tuple[Experiment, int]:
        """Return channels and marks of measured samples, and how many samples are left over."""
        step = samples.sample_time_s
        kept = self.stretch(recording, len(samples), step)
        if self.gaps == "refuse" and (hole := samples.first_hole(kept)):
            raise DataRejected(hole)
        n_recorded = kept.stop - kept.start
        try:
            n_per_period = samples_per_period(n_recorded, step, period_s)
        except DataRejected as error:
            values, _ = samples.window(kept, self.channels, robot.axis_names, None)
            raise DataRejected(f"{error}{clock_of_period(values, period_s or 0.0)}") from None
        kept = slice(kept.start, kept.start + n_recorded // n_per_period * n_per_period)
        values, known = samples.window(
            kept, self.channels, robot.axis_names, n_per_period if period_s is not None else None
        )
        if self.gaps == "refuse":  # nothing is missing but at ends that were lost
            inner = np.flatnonzero(known)
            ends = slice(int(inner[0]), int(inner[-1]) + 1)
            values, known = {name: one[ends] for name, one in values.items()}, known[ends]
            n_per_period = samples_per_period(len(known), step, period_s)
        parts = {name: split_periods(one, n_per_period) for name, one in values.items()}
        marks: BoolArray = split_periods(known[:, None].astype(np.float64), n_per_period)[..., 0] > 0
        return (parts, marks), n_recorded - int(marks.size)

    def _source(self, arrangement: Arrangement) -> str:
        """Say where the record comes from."""
        kind = reader_name(arrangement.recordings[0][0][0].file, self.format) or BAG_READER
        count = int(np.prod(arrangement.shape))
        recordings = f"{count} recordings, " if count > 1 else ""
        torque = self.channels.get("motor_torque")
        modelled = torque is not None and torque.voltage is not None
        law = "; motor_torque computed from the voltage by a model of the motor" if modelled else ""
        return f"{self.source_name} ({recordings}{kind}{law})"


def _at(arrangement: Arrangement, place: tuple[int, ...]) -> Recording:
    configuration, block, experiment = place
    return arrangement.recordings[configuration][block][experiment]


def _with_constants(arrangement: Arrangement, scalars: Mapping[Index, Mapping[str, float]]) -> Arrangement:
    """Return the arrangement with constants more."""
    recordings = tuple(
        tuple(
            tuple(
                replace(one, constants={**one.constants, **scalars[c, b, e]})
                for e, one in enumerate(experiments)
            )
            for b, experiments in enumerate(blocks)
        )
        for c, blocks in enumerate(arrangement.recordings)
    )
    return replace(arrangement, recordings=recordings)


def _dense_run(
    arrangement: Arrangement, channels: dict[str, Channel], known: BoolArray, sample_time: float
) -> DenseRun:
    """Return the run of all experiments, with their roles and constants where there are any."""
    shape = next(iter(channels.values())).values.shape

    def each(value: Callable[[Recording], Any]) -> Any:
        return np.array(
            [[[value(one) for one in block] for block in blocks] for blocks in arrangement.recordings]
        )

    constants = tuple(_at(arrangement, (0, 0, 0)).constants)
    test = each(lambda one: one.test)
    return DenseRun(
        sample_time_s=sample_time,
        channels=channels,
        time_s=np.arange(shape[4], dtype=np.float64) * sample_time,
        valid=frozen(known),
        test=test if test.any() else None,
        constant_names=constants,
        constants=each(lambda one: [one.constants[name] for name in constants]) if constants else None,
    )


def _of_role(record: Record, role: str) -> Record:
    """Return the record with one role for all its experiments."""
    shapes = (run.valid.shape[:3] for run in record.runs)
    tests = [np.ones(shape, dtype=bool) if role == "test" else None for shape in shapes]
    return record.replace(
        runs=tuple(run.replace(test=test) for run, test in zip(record.runs, tests, strict=True))
    )
