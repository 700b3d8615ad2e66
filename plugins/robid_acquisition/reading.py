"""Settings of the channels and of time, and a file read by them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from robid_acquisition.channel_map import ChannelMap, check_quantity
from robid_acquisition.channel_values import (
    channel_table,
    channel_values,
    covered_axes,
    enabled_rows,
    refuse_other_lengths,
    select,
)
from robid_acquisition.data_file import find_file, reader_name, reader_of
from robid_acquisition.recording import Recording
from robid_acquisition.resampling import on_even_grid
from robid_acquisition.samples import Hole, Samples
from robid_acquisition.scalars import Scalars, scalar_values
from robid_acquisition.signals import refuse_beyond, to_side, window
from robid_acquisition.sources import Sources
from robid_acquisition.time_stamps import ALIKE, SECONDS, TimeStamps, likely_unit
from robid_core import BoolArray, Context, DataRejected, FloatArray, Robot, Settings

CUT = "cut the recording before it or repair it"
LARGEST = 1e30  # beyond, squares and their sums overflow, and no unit makes a measurement of it
SHORTEST = 10  # samples; fewer tell of no motion
ON_LINK = "link_"  # begins the names of channels of inertial units


class LowPass(Settings):
    """Butterworth low-pass, forward and backward: no phase, half the amplitude at its edge."""

    low_pass_hz: PositiveFloat
    """Edge, Hz."""
    order: PositiveInt = 4
    """Order of the filter one way."""


class ReadFiles(Sources):
    """Settings that say what the files hold, and what follows from them."""

    channels: dict[str, ChannelMap] = {}
    """Channel name to its place in the file; motor_position and motor_torque are what most stages need."""
    sample_time_s: PositiveFloat | None = None
    """Sampling time; either this or `time_column`, both where `resample` brings the one to the other."""
    time_column: str = ""
    """Column with the sampling instants; uneven ones need `resample`."""
    time_unit: Annotated[str, Field(pattern="^(s|ms|us|ns)$")] = "s"
    """Unit of the time column."""
    resample: Literal["none", "linear", "cubic", "band_limited"] = "none"
    """How uneven samples are brought to an even grid, of the mean rate or of `sample_time_s`; a warning states
    the error."""
    gaps: Literal["refuse", "mask", "split"] = "refuse"
    """Missing samples, NaN, a drive that is not enabled: refused; masked, for stages that take holes; or the pieces
    between them become experiments of equal length."""
    filter: LowPass | None = None
    """A low-pass on all channels, before anything is cut."""
    scalars: Scalars = {}
    """Single numbers in the files that are kept as constants of their experiments: `[kp, payload]`, or under another
    name and with a factor, `{payload_kg: {column: payload, scale: 0.001}}`."""
    drop_first_s: NonNegativeFloat = 0.0
    """Left out at the beginning of each experiment, s."""
    drop_last_s: NonNegativeFloat = 0.0
    """Left out at the end of each experiment, s."""

    @model_validator(mode="after")
    def _channels_agree(self) -> ReadFiles:
        for name, channel in self.channels.items():
            check_quantity(name, channel)
            if channel.file and not self.path:
                raise ValueError(
                    f"channels: {name} comes from a file of its own, which goes with `path` only"
                )
        if not self.channels and (not self.path or self.starts_s):
            raise ValueError("channels are missing: a map from names to columns of the files")
        given = (self.sample_time_s is not None, bool(self.time_column))
        if self.channels and (not any(given) or (all(given) and self.resample == "none")):
            hint = "; both go with resample" if all(given) else ""
            raise ValueError(f"give either sample_time_s or time_column{hint}")
        if self.resample != "none" and not self.time_column:
            raise ValueError("resample needs time_column")
        return self

    def external_files(self, data_root: Path) -> list[Path]:
        """Return the files read, those of single channels too, so that a changed file is a changed input."""
        files = [*super().external_files(data_root), *(data_root / file for file in self.channel_files())]
        return list(dict.fromkeys(files))

    def uses(self) -> list[tuple[str, str]]:
        """Return the readers that will be loaded, so that an edited reader is a changed input."""
        names = {reader_name(file, self.format) for file in self.channel_files()}
        return sorted({*super().uses(), *(("robid.records", name) for name in names if name)})

    def channel_files(self) -> list[str]:
        """Return the files of channels that lie elsewhere."""
        return [channel.file for channel in self.channels.values() if channel.file]

    def read(self, file: str, robot: Robot, context: Context) -> Samples:
        """Read a file, and those of channels that lie elsewhere.

        Raises
        ------
        DataRejected
            If a column is missing or of another length, the clock does not run forward, or it runs unevenly and nothing
            says how to resample.
        """
        columns = {
            name: reader_of(context.data_root, name, self.format).read(
                find_file(context.data_root, name, self.origin)
            )
            for name in dict.fromkeys([file, *self.channel_files()])
        }
        own = {name: columns[channel.file or file] for name, channel in self.channels.items()}
        tables = {
            name: channel_table(own[name], name, channel, robot.axis_names)
            for name, channel in self.channels.items()
        }
        for name, table in tables.items():
            if len(far := np.argwhere((np.abs(table) > LARGEST) & np.isfinite(table))):
                raise DataRejected(
                    f"channel {name} is {table[tuple(far[0])]:.3g} at sample {far[0][0]}, which no sensor measures; is "
                    "the file damaged?"
                )
        refuse_other_lengths({name: len(table) for name, table in tables.items()})
        n_row = len(next(iter(tables.values())))
        if n_row < SHORTEST:
            count = "1 sample" if n_row == 1 else f"{n_row} samples"
            raise DataRejected(
                f"{count} only, where a motion needs {SHORTEST} and more; was "
                "the file cut, or its recording stopped? Record it again, or leave it out"
            )
        stamps = self.time_stamps(columns[file], n_row, robot)
        instant = np.arange(n_row, dtype=np.float64)
        if stamps is not None:
            instant = (stamps.time - stamps.time[0]) / stamps.sample_time_s
        holes = self._missing(tables, robot.axis_names)
        for name, channel in self.channels.items():
            enabled = enabled_rows(own[name], name, channel, robot.axis_names)
            if enabled is not None:
                if len(enabled) != n_row:
                    raise DataRejected(f"A06: channel {name}: {n_row} samples and {len(enabled)} of enable")
                words = f"A08: the drives of channel {name}"
                remedy = "keep the part where they are (start_s, stop_s)"
                holes.append(Hole(words, "are not enabled", ~enabled, remedy))
        values = {
            name: self._at_its_side(
                channel_values(tables[name], name, channel, robot.axis_names, instant), name, robot
            )
            for name, channel in self.channels.items()
        }
        samples = replace(
            self._even(file, values, holes, stamps), scalars=scalar_values(columns[file], self.scalars)
        )
        return (
            samples if self.filter is None else samples.filtered(self.filter.low_pass_hz, self.filter.order)
        )

    def stretch(self, recording: Recording, n_sample: int, step: float) -> slice:
        """Return the samples of an experiment, of those that its file has; DataRejected where it has not as many."""
        start_s = self.start_s if recording.start_s is None else recording.start_s
        stop_s = self.stop_s if recording.stop_s is None else recording.stop_s
        if not self.starts_s:  # else its duration ends it
            refuse_beyond(n_sample, step, stop_s)
        return window(n_sample, step, start_s, stop_s, self.drop_first_s, self.drop_last_s)

    def _at_its_side(self, values: FloatArray, name: str, robot: Robot) -> FloatArray:
        if name.startswith(ON_LINK):  # in the sensor's own axes, whatever the axis' gear is
            return values
        side = "motor" if self.channels[name].voltage is not None else self.channels[name].side
        return to_side(values, name, side, side_of(name), robot.drives.gear)

    def time_stamps(self, columns: dict[str, FloatArray], n_row: int, robot: Robot) -> TimeStamps | None:
        """Return the time stamps; None where they are not read."""
        if not self.time_column:
            self._refuse_other_unit(robot)
            return None
        stamps = TimeStamps.of(select(columns, self.time_column) * SECONDS[self.time_unit])
        if len(stamps.time) != n_row:
            raise DataRejected(f"A06: the channels have {n_row} samples and time {len(stamps.time)}")
        if unit := likely_unit(stamps.sample_time_s, robot.sample_time_s, self.time_unit):
            raise DataRejected(
                f"{self.time_column} goes by {stamps.sample_time_s:g} s from sample to sample, and the drives of "
                f"{robot.name} are sampled every {robot.sample_time_s:g} s: it looks like {unit}; set time_unit: {unit}"
            )
        if stamps.number is None and self.resample == "none":
            raise DataRejected(stamps.refusal())
        return stamps

    def _refuse_other_unit(self, robot: Robot) -> None:
        """Refuse a sampling time that is a rate, or in another unit, where that is the robot's."""
        given, expected = self.sample_time_s or 0.0, robot.sample_time_s
        unit = (
            "a rate in Hz"
            if given > 1 and abs(given * expected - 1) < ALIKE
            else likely_unit(given, expected, "s")
        )
        if unit:
            raise DataRejected(
                f"sample_time_s: {given:g} in the channel map, where the drives of {robot.name} are sampled every "
                f"{expected:g} s: it looks like {unit}; write sample_time_s: {expected:g}"
            )

    def _missing(self, tables: dict[str, FloatArray], axis_names: tuple[str, ...]) -> list[Hole]:
        """Rows without a value, by channel and axis."""
        holes = []
        for name, channel in self.channels.items():
            for k, axis in enumerate(covered_axes(name, channel, axis_names)):
                bad: BoolArray = ~np.isfinite(tables[name][:, k])
                if bad.any():
                    column = channel.columns[min(k, len(channel.columns) - 1)]
                    words = f"A05: channel {name} ({column}), {axis}"
                    holes.append(Hole(words, "are NaN or infinite", bad, CUT))
        return holes

    def _even(
        self, file: str, values: dict[str, FloatArray], holes: list[Hole], stamps: TimeStamps | None
    ) -> Samples:
        """Return samples on an even grid, from rows that may lie unevenly or lack some."""
        if stamps is None:
            assert self.sample_time_s is not None
            return Samples(file, _without(values, holes), self.sample_time_s, tuple(holes))
        if self.resample == "none" or (stamps.number is not None and self.sample_time_s is None):
            assert stamps.number is not None
            n_sample = int(stamps.number[-1]) + 1
            missing = np.ones(n_sample, dtype=bool)
            missing[stamps.number] = False
            placed = {name: _placed(one, stamps.number, n_sample) for name, one in values.items()}
            moved = [
                Hole(hole.what, hole.state, _placed(hole.where, stamps.number, n_sample, False), hole.remedy)
                for hole in holes
            ]
            if missing.any():
                first = int(np.argmax(missing))
                words = f"A10: the clock jumps after {first * stamps.sample_time_s:.4g} s"
                moved.append(Hole(words, "are missing", missing, CUT))
            made = Samples(file, _without(placed, moved), stamps.sample_time_s, tuple(moved))
            return replace(made, notes=(f"{file}: {stamps.jitter()}",)) if stamps.jitter() else made
        return self._resampled(file, values, holes, stamps)

    def _resampled(
        self, file: str, values: dict[str, FloatArray], holes: list[Hole], stamps: TimeStamps
    ) -> Samples:
        known = np.ones(len(stamps.time), dtype=bool)
        for hole in holes:
            known &= ~hole.where
        step = self.sample_time_s or stamps.sample_time_s
        assert self.resample != "none"
        covered = {name: ~np.isnan(one).all(axis=0) for name, one in values.items()}
        tables = {name: one[:, covered[name]] for name, one in values.items()}
        held = [name for name, channel in self.channels.items() if channel.hold]
        even, errors = on_even_grid(tables, known, stamps.time, step, self.resample, held)
        n_sample = len(next(iter(even.values())))
        spread = {name: np.full((n_sample, one.shape[1]), np.nan) for name, one in values.items()}
        for name, one in spread.items():
            one[:, covered[name]] = even[name]
        lost = np.zeros(n_sample, dtype=bool)
        for one in even.values():
            lost |= ~np.isfinite(one).all(axis=1)
        inner = np.flatnonzero(~lost)
        if not len(inner):
            raise DataRejected(f"resample: no piece is long enough for {self.resample}; take linear")
        lost[: inner[0]], lost[inner[-1] + 1 :] = False, False  # ends, which are cut
        words = [hole.what for hole in holes] or ["A10: the clock jumps"]
        told = ", ".join(
            f"{name} {np.max(error):.2g} {self.channels[name].read_symbol}" for name, error in errors.items()
        )
        note = (
            f"{file}: steps of time differ from the mean one by up to {100 * stamps.unevenness[0]:.3g} %; resampled "
            f"({self.resample}) to {1 / step:.6g} Hz, which brings an error of about (rms, of the worst axis): {told}"
        )
        gaps = (Hole("; ".join(words), "are missing", lost, CUT),) if lost.any() else ()
        return Samples(file, spread, step, gaps, (note,), resampled=True)


def side_of(name: str) -> str:
    """Side of the gear on which a record keeps a channel."""
    return "joint" if name.startswith(("joint_", ON_LINK)) else "motor"


def _without(values: dict[str, FloatArray], holes: list[Hole]) -> dict[str, FloatArray]:
    """Values with NaN in holes."""
    for hole in holes:
        values = {name: np.where(hole.where[:, None], np.nan, one) for name, one in values.items()}
    return values


def _placed(values: np.ndarray, number: np.ndarray, n_sample: int, fill: float | bool = np.nan) -> np.ndarray:
    result = np.full((n_sample, *values.shape[1:]), fill, dtype=values.dtype)
    result[number] = values
    return result
