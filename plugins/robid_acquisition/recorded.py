"""Recordings made elsewhere as one record: files that a `robid.records` reader knows, and a channel map.

The files lie below the data root (`ROBID_DATA` or `--data`), are never written, and count by their SHA-256. Channels
come out in SI units with the sign of the robot's axes: `joint_...` on the joint side, everything else at the motor
shaft, whatever side of the gear the files state. One file holds one experiment; a pattern of names, a table, or the
times at which experiments begin in a long file say which experiments many are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat, model_validator

from robid_acquisition.arrangement import Arrangement, arrange, listed
from robid_acquisition.assembly import Assembly, name_file
from robid_acquisition.channel_map import ChannelMap, channel_table, channel_values, check_quantity, select
from robid_acquisition.data_file import advice, find_file, reader_name, reader_of, refuse_others
from robid_acquisition.plausible import sentence, slips_of
from robid_acquisition.poses import mean_angle, unlike_poses
from robid_acquisition.recording import Recording
from robid_acquisition.signals import (
    SECONDS,
    even_sample_time,
    samples_per_period,
    split_periods,
    to_side,
    window,
)
from robid_acquisition.sources import Sources
from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    FloatArray,
    Record,
    RobidError,
    Robot,
    frozen,
)


@dataclass(frozen=True)
class Samples:
    """Channels of a file as it states them, each (n_sample, n_covered), and the time from sample to sample."""

    file: str
    tables: dict[str, FloatArray]
    sample_time_s: float


class RecordedAcquisition(Sources):
    """Reads recordings through a channel map: one file, a pattern of files, or those that a table lists.

    acquire:
      use: acquisition.recorded
      with:
        pattern: "lab/c{config}_b{block}_e{exp}.npz"
        sample_time_s: 0.0005
        period_s: 4.0
        lines: [17, 19, 21]
        channels:
          motor_position: {column: q, unit: rad}
          motor_torque: {column: current, unit: A, scale: 0.43, unit_to: N m}
    """

    channels: dict[str, ChannelMap] = {}
    """Channel name to its place in the file; motor_position and motor_torque are what most stages need."""
    sample_time_s: PositiveFloat | None = None
    """Sampling time; either this or `time_column`."""
    time_column: str = ""
    """Column with the sampling instants; it must be even."""
    time_unit: Annotated[str, Field(pattern="^(s|ms|us|ns)$")] = "s"
    """Unit of the time column."""
    period_s: PositiveFloat | None = None
    """Period of the excitation: whole periods are kept apart. None: nothing repeats."""
    lines: tuple[NonNegativeInt, ...] = ()
    """Excited bins of one period, for frequency responses."""
    torque_hold: Annotated[str, Field(pattern="^(zero_order_hold|continuous)$")] = "continuous"
    """How torque goes between samples; continuous where the recording does not tell."""
    plausibility: Literal["refuse", "warn", "ignore"] = "refuse"
    """What becomes of a record that fits the robot file only with a sign turned, in another unit, on the other side of
    the gear, or with axes exchanged: the message says which."""
    angle_tolerance: PositiveFloat = 0.01
    """Joint angle (rad, or m) by which the poses of one configuration may differ from their mean without a warning."""

    @model_validator(mode="after")
    def _settings_agree(self) -> RecordedAcquisition:
        for name, channel in self.channels.items():
            check_quantity(name, channel)
            if channel.file and not self.path:
                raise ValueError(
                    f"channels: {name} comes from a file of its own, which goes with `path` only"
                )
        if not self.channels and (not self.path or self.starts_s):
            raise ValueError("channels are missing: a map from names to columns of the files")
        if self.channels and (self.sample_time_s is None) == (not self.time_column):
            raise ValueError("give either sample_time_s or time_column")
        if self.lines and self.period_s is None:
            raise ValueError("lines need period_s")
        return self

    def external_files(self, data_root: Path) -> list[Path]:
        """Return the files read, those of single channels too, so that a changed file is a changed input."""
        files = [*super().external_files(data_root), *(data_root / file for file in self._channel_files())]
        return list(dict.fromkeys(files))

    def uses(self) -> list[tuple[str, str]]:
        """Return the readers that will be loaded, so that an edited reader is a changed input."""
        names = {reader_name(file, self.format) for file in self._channel_files()}
        return sorted({*super().uses(), *(("robid.records", name) for name in names if name)})

    def _channel_files(self) -> list[str]:
        return [channel.file for channel in self.channels.values() if channel.file]

    def run(self, robot: Robot, context: Context) -> Record:
        """Find, read, convert and cut, one file after the other."""
        root, name = context.data_root, self.source_name
        if root is None:
            raise ConfigurationError(f"no data folder is set; {advice(name, self.origin)}")
        if self.path:
            find_file(root, self.path, self.origin)
        refuse_others(super().external_files(root), self.sha256, name, self.origin)
        if not self.channels:
            record = _own_record(reader_of(name, self.format), root / name, robot)
            if self.variant:
                record = record.replace(variants=(self.variant,) * len(record.angle))
        else:
            arrangement = arrange(self.recordings(root))
            self._tell(arrangement, context)
            record = self._record(arrangement, robot, context)
        self._check(record, robot, context)
        return _of_role(record, self.role) if self.role else record

    def _check(self, record: Record, robot: Robot, context: Context) -> None:
        """Refuse a record that a slip in the channel map, or in the robot file, explains; or warn of it."""
        slips = slips_of(record, robot) if self.plausibility != "ignore" else []
        if not slips:
            return
        if self.plausibility == "refuse":
            raise DataRejected(
                f"{self.source_name}: {sentence(slips)}. Mend the channel map, or the robot file where that is wrong; "
                "plausibility: warn takes the record as it is"
            )
        context.log.warning("%s", sentence(slips))

    def _tell(self, arrangement: Arrangement, context: Context) -> None:
        """Warn of what is missing, or refuse."""
        if arrangement.shortfalls and self.incomplete == "refuse":
            raise DataRejected(f"{'. '.join(arrangement.shortfalls)}; add the files, or set incomplete: drop")
        for words in arrangement.shortfalls:
            context.log.warning("%s", words)

    def _record(self, arrangement: Arrangement, robot: Robot, context: Context) -> Record:
        """Read every experiment and put the record together."""
        shape = arrangement.shape
        assembly = Assembly(shape, self.period_s is not None)
        samples: Samples | None = None
        angle = np.zeros((*shape, robot.n_axis))
        rests: list[str] = []
        places = sorted(np.ndindex(*shape), key=lambda place: _at(arrangement, place).file)  # each file once
        for place in context.track(places, len(places), "reading recordings"):
            recording = _at(arrangement, place)
            try:
                if samples is None or samples.file != recording.file:
                    samples = self._read(recording.file, robot, context)
                values, rest = self._experiment(recording, samples, robot)
                assembly.put(place, recording.name, values, samples.sample_time_s)
            except RobidError as error:
                if len(places) > 1:
                    name_file(recording.name, error)
                raise
            angle[place] = mean_angle(values, robot)
            if rest:
                rests.append(f"{rest} samples of {recording.name}")
        if rests:
            context.log.warning("A11: left out after the last whole period: %s", listed(rests))
        if cut := assembly.cut():
            context.log.warning("A11: %s", cut)
        if unlike := unlike_poses(arrangement, angle, self.angle_tolerance, robot.axis_names):
            context.log.warning("%s", unlike)
        names = arrangement.variants if any(arrangement.variants) else (self.variant,) * shape[0]
        channels = {
            name: Channel(_side(name), self.channels[name].symbol, frozen(values))
            for name, values in assembly.channels.items()
        }
        return Record(
            axis_names=robot.axis_names,
            source=self._source(arrangement),
            torque_hold=self.torque_hold,
            runs=(_dense_run(arrangement, channels, assembly.sample_time_s),),
            angle=angle.mean(axis=(1, 2)),
            line=np.array(self.lines, dtype=np.int64) if self.lines else None,
            variants=names if any(names) else (),
        )

    def _read(self, file: str, robot: Robot, context: Context) -> Samples:
        """Read a file, and those of channels that lie elsewhere."""
        columns = {
            name: reader_of(name, self.format).read(find_file(context.data_root, name, self.origin))
            for name in dict.fromkeys([file, *self._channel_files()])
        }
        tables = {
            name: channel_table(columns[channel.file or file], name, channel, robot.axis_names)
            for name, channel in self.channels.items()
        }
        lengths = {name: len(table) for name, table in tables.items()}
        if len(set(lengths.values())) > 1:
            raise DataRejected(f"A06: the channels have different lengths: {lengths}")
        sample_time = self.sample_time_s or even_sample_time(
            select(columns[file], self.time_column) * SECONDS[self.time_unit]
        )
        return Samples(file, tables, sample_time)

    def _experiment(
        self, recording: Recording, samples: Samples, robot: Robot
    ) -> tuple[dict[str, FloatArray], int]:
        """Return channels, each (n_period, n_sample, n_axis), and how many samples are left over."""
        start_s = self.start_s if recording.start_s is None else recording.start_s
        stop_s = self.stop_s if recording.stop_s is None else recording.stop_s
        n_recorded = len(next(iter(samples.tables.values())))
        kept = window(n_recorded, samples.sample_time_s, start_s, stop_s)
        n_sample = kept.stop - kept.start
        n_per_period = samples_per_period(n_sample, samples.sample_time_s, self.period_s)
        values = {}
        for name, channel in self.channels.items():
            given = channel_values(samples.tables[name][kept], name, channel, robot.axis_names, kept.start)
            moved = to_side(given, name, channel.side, _side(name), robot.drives.gear)
            values[name] = split_periods(moved, n_per_period)
        return values, n_sample % n_per_period

    def _source(self, arrangement: Arrangement) -> str:
        """Say where the record comes from."""
        reader = reader_of(arrangement.recordings[0][0][0].file, self.format)
        kind = reader.__name__ if isinstance(reader, type) else type(reader).__name__
        count = int(np.prod(arrangement.shape))
        recordings = f"{count} recordings, " if count > 1 else ""
        return f"{self.source_name} ({recordings}{kind})"


def _side(name: str) -> str:
    return "joint" if name.startswith("joint_") else "motor"


def _at(arrangement: Arrangement, place: tuple[int, ...]) -> Recording:
    configuration, block, experiment = place
    return arrangement.recordings[configuration][block][experiment]


def _dense_run(arrangement: Arrangement, channels: dict[str, Channel], sample_time: float) -> DenseRun:
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
        valid=np.ones(shape[:5], dtype=bool),
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


def _own_record(reader: Any, full: Path, robot: Robot) -> Record:
    """Take the record that a reader of robid's own recordings makes."""
    if not hasattr(reader, "read_record"):
        described = "\n  ".join(reader.describe(full))
        raise ConfigurationError(
            f"{full.name} needs channels: a map from names to columns; it holds\n  {described}"
        )
    record: Record = reader.read_record(full)
    if record.axis_names != robot.axis_names:
        raise DataRejected(
            f"A06: {full.name} was recorded with the axes {', '.join(record.axis_names)}, the robot has "
            f"{', '.join(robot.axis_names)}"
        )
    return record
