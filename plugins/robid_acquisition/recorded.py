"""A recording made elsewhere as a record: any file that a `robid.records` reader knows, and a channel map.

The file lies below the data root (`ROBID_DATA` or `--data`), is never written, and is told by its SHA-256. Channels
come out in SI units with the sign of the robot's axes: `joint_...` on the joint side, everything else at the motor
shaft, whatever side of the gear the file states.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, FiniteFloat, NonNegativeFloat, NonNegativeInt, PositiveFloat, model_validator

from robid_acquisition.channel_map import ChannelMap, channel_values, check_quantity, select
from robid_core import (
    Acquisition,
    Channel,
    ConfigurationError,
    Context,
    DataPath,
    DataRejected,
    DenseRun,
    FloatArray,
    Record,
    Robot,
    load_plugin,
)

SUFFIXES = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".dat": "csv",
    ".mat": "mat",
    ".npz": "npz",
    ".mcap": "mcap",
}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# A time step may differ from the mean one by this share before the recording counts as unevenly sampled.
STEP_TOLERANCE = 0.1


def even_sample_time(time: FloatArray) -> float:
    """Mean sampling time of evenly spaced instants in seconds.

    Raises
    ------
    DataRejected
        If the clock stands, runs back or jumps (fault A10); the message has the sample.
    """
    if time.ndim != 1 or len(time) < 2:
        raise DataRejected(f"the time column has shape {time.shape}; one instant per sample is needed")
    steps = np.diff(time)
    known = steps[np.isfinite(steps)]
    mean = float(np.median(known)) if len(known) else float("nan")
    wrong = np.flatnonzero(~(np.abs(steps - mean) <= STEP_TOLERANCE * abs(mean)) | (steps <= 0))
    if len(wrong):
        raise DataRejected(
            f"A10: time goes from {time[wrong[0]]:g} s to {time[wrong[0] + 1]:g} s at sample {wrong[0] + 1}, the usual "
            f"step is {mean:g} s ({len(wrong)} such steps); resample it evenly, or give sample_time_s where only the "
            "time stamps are wrong"
        )
    return float((time[-1] - time[0]) / (len(time) - 1))


def split_periods(values: FloatArray, n_per_period: int) -> FloatArray:
    """Cut whole periods, the rest dropped: (n_sample, n_axis) to (n_period, n_per_period, n_axis)."""
    n_period = len(values) // n_per_period
    return values[: n_period * n_per_period].reshape(n_period, n_per_period, -1)


def to_side(values: FloatArray, name: str, given: str, wanted: str, gear: FloatArray) -> FloatArray:
    """Bring values through the gear: joint = gear @ motor for motion, motor = gear^T @ joint for torque.

    Parameters
    ----------
    values
        Shape (n_sample, n_axis).
    name
        Channel; one with "torque" in it is a torque, any other of position, speed, acceleration is motion.
    given, wanted
        "motor" or "joint".
    gear
        r_g, shape (n_axis, n_axis).
    """
    if given == wanted or not any(word in name for word in ("position", "speed", "acceleration", "torque")):
        return values
    if np.isnan(values).any() and np.count_nonzero(gear - np.diag(np.diag(gear))):
        raise DataRejected(
            f"channel {name}: the gears are coupled; all axes are needed to bring it to the {wanted} side"
        )
    matrix = gear.T if "torque" in name else np.linalg.inv(gear)
    if wanted == "joint":
        matrix = np.linalg.inv(matrix)
    if not np.count_nonzero(gear - np.diag(np.diag(gear))):
        result: FloatArray = values * np.diag(matrix)
        return result
    return values @ matrix.T


def read_file(root: Path | None, path: str, format_name: str, sha256: str, origin: str) -> tuple[Any, Path]:
    """Return the reader of a data file and where the file is; checks that it is there and the one meant."""
    source = f"get it from {origin} and " if origin else ""
    advice = f"{source}set ROBID_DATA or pass --data to the folder that holds {path}"
    if root is None:
        raise ConfigurationError(f"no data folder is set; {advice}")
    full = Path(root) / path
    if not full.is_file():
        raise ConfigurationError(f"there is no file {full}; {advice}")
    if sha256:
        found = hashlib.sha256(full.read_bytes()).hexdigest()
        if found != sha256.lower():
            raise DataRejected(
                f"A13: {path} is another file than the one this pipeline was written for: its sha256 is {found}; "
                f"{advice}, or correct sha256"
            )
    name = format_name or SUFFIXES.get(full.suffix.lower(), "")
    if not name:
        raise ConfigurationError(f"{path}: no reader for '{full.suffix}'; give format: csv, mat, npz, mcap")
    return load_plugin("robid.records", name), full


class RecordedAcquisition(Acquisition):
    """Reads a recording through a channel map.

    acquire:
      use: acquisition.recorded
      with:
        origin: "https://www.nonlinearbenchmark.org"
        path: emps/DATA_EMPS.mat
        time_column: t
        channels:
          motor_position: {column: qm, unit: m}
          motor_torque: {column: vir, unit: V, scale: 35.15, unit_to: N}
    """

    origin: str = ""
    """Where the file can be had, for the message when it is missing."""
    path: DataPath
    """The file, relative to the data root; a channel may name another one."""
    format: str = ""
    """Reader (csv, mat, npz, mcap or a plugin's); by default from the file's suffix."""
    sha256: Annotated[str, Field(pattern="^([0-9a-fA-F]{64})?$")] = ""
    """Checked where given: another file is refused."""
    channels: dict[str, ChannelMap] = {}
    """Channel name to its place in the file; motor_position and motor_torque are what most stages need."""
    sample_time_s: PositiveFloat | None = None
    """Sampling time; either this or `time_column`."""
    time_column: str = ""
    """Column with the sampling instants; it must be even."""
    time_unit: Annotated[str, Field(pattern="^(s|ms|us|ns)$")] = "s"
    """Unit of the time column."""
    start_s: NonNegativeFloat = 0.0
    """What lies before this time is left out."""
    stop_s: FiniteFloat | None = None
    """What lies after this time is left out."""
    period_s: PositiveFloat | None = None
    """Period of the excitation: whole periods are kept apart. None: nothing repeats."""
    lines: tuple[NonNegativeInt, ...] = ()
    """Excited bins of one period, for frequency responses."""
    torque_hold: Annotated[str, Field(pattern="^(zero_order_hold|continuous)$")] = "continuous"
    """How torque goes between samples; continuous where the recording does not tell."""

    @model_validator(mode="after")
    def _settings_agree(self) -> RecordedAcquisition:
        for name, channel in self.channels.items():
            check_quantity(name, channel)
        if self.channels and (self.sample_time_s is None) == (not self.time_column):
            raise ValueError("give either sample_time_s or time_column")
        if self.lines and self.period_s is None:
            raise ValueError("lines need period_s")
        return self

    def external_files(self, data_root: Path) -> list[Path]:
        """Return the files read, so that a changed file is a changed input."""
        return [data_root / file for file in self._files()]

    def uses(self) -> list[tuple[str, str]]:
        """Return the readers that will be loaded, so that an edited reader is a changed input."""
        names = {self.format or SUFFIXES.get(Path(file).suffix.lower(), "") for file in self._files()}
        return [("robid.records", name) for name in sorted(names) if name]

    def _files(self) -> list[str]:
        return list(dict.fromkeys([self.path, *(c.file for c in self.channels.values() if c.file)]))

    def run(self, robot: Robot, context: Context) -> Record:
        """Read, convert, cut."""
        reader, full = read_file(context.data_root, self.path, self.format, self.sha256, self.origin)
        if not self.channels:
            return _own_record(reader, full, robot)
        files: dict[str, dict[str, FloatArray]] = {self.path: reader.read(full)}
        for path in self._files()[1:]:
            other, place = read_file(context.data_root, path, self.format, "", self.origin)
            files[path] = other.read(place)
        columns = files[self.path]
        values = {
            name: channel_values(files[channel.file or self.path], name, channel, robot.axis_names)
            for name, channel in self.channels.items()
        }
        lengths = {name: len(value) for name, value in values.items()}
        if len(set(lengths.values())) > 1:
            raise DataRejected(f"A06: the channels have different lengths: {lengths}")
        sample_time = self.sample_time_s or even_sample_time(
            select(columns, self.time_column) * SECONDS[self.time_unit]
        )
        first, stop = self._window(next(iter(lengths.values())), sample_time)
        n_per_period = self._samples_per_period(sample_time, stop - first, context)
        channels = {}
        for name, channel in self.channels.items():
            side = "joint" if name.startswith("joint_") else "motor"
            moved = to_side(values[name][first:stop], name, channel.side, side, robot.drives.gear)
            shaped = split_periods(moved, n_per_period)[None, None, None]
            channels[name] = Channel(side=side, unit_symbol=channel.symbol, values=shaped)
        return Record(
            axis_names=robot.axis_names,
            source=f"{self.path} ({type(reader).__name__ if not isinstance(reader, type) else reader.__name__})",
            torque_hold=self.torque_hold,
            runs=(_dense_run(channels, sample_time),),
            angle=_mean_angle(channels, robot)[None],
            line=np.array(self.lines, dtype=np.int64) if self.lines else None,
        )

    def _window(self, n_sample: int, sample_time: float) -> tuple[int, int]:
        first = round(self.start_s / sample_time)
        stop = n_sample if self.stop_s is None else min(n_sample, round(self.stop_s / sample_time))
        if stop - first < 2:
            raise DataRejected(
                f"{self.path}: nothing lies between start_s and stop_s; it lasts {n_sample * sample_time:g} s"
            )
        return first, stop

    def _samples_per_period(self, sample_time: float, n_sample: int, context: Context) -> int:
        if self.period_s is None:
            return n_sample
        exact = self.period_s / sample_time
        whole = round(exact)
        # A tenth of a sample over the whole recording leaks less than the noise of any encoder.
        if whole < 1 or abs(exact - whole) * (n_sample / max(whole, 1)) > 0.1:
            raise DataRejected(
                f"A09: a period of {self.period_s:g} s is {exact:.6g} samples of {sample_time:g} s, not a whole "
                "number; correct period_s or resample"
            )
        if n_sample < whole:
            raise DataRejected(
                f"A11: {n_sample * sample_time:g} s were recorded, less than a period of {self.period_s:g} s"
            )
        rest = n_sample % whole
        if rest:
            context.log.warning(
                "A11: %s: %d samples after the last whole period are left out", self.path, rest
            )
        return whole


def _dense_run(channels: dict[str, Channel], sample_time: float) -> DenseRun:
    shape = next(iter(channels.values())).values.shape
    return DenseRun(
        sample_time_s=sample_time,
        channels=channels,
        time_s=np.arange(shape[4], dtype=np.float64) * sample_time,
        valid=np.ones(shape[:5], dtype=bool),
    )


def _mean_angle(channels: dict[str, Channel], robot: Robot) -> FloatArray:
    """Mean motor angle seen through the gear, shape (n_axis,); the joint's own where no motor angle was recorded."""
    for name in ("motor_position", "joint_position"):
        if name in channels:
            mean: FloatArray = channels[name].values.mean(axis=(0, 1, 2, 3, 4))
            known = np.nan_to_num(mean)
            return robot.joint_angle(known) if name == "motor_position" else known
    return np.zeros(robot.n_axis)


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
