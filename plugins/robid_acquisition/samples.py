"""The channels of one file in SI units at evenly spaced instants, with their holes; and what of them an experiment is.

In this order: values are converted, rows where a drive was not enabled or a value is missing are holes, uneven ones are
brought to an even grid, and all is filtered. Of the window of an experiment each channel is then moved back by its
delay, and a torque is made of a voltage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from robid_acquisition.channel_map import ChannelMap
from robid_acquisition.delays import REACH, moved_back, moved_back_periodic
from robid_acquisition.motor_model import torque_from_voltage
from robid_core import BoolArray, DataRejected, FloatArray
from robid_core.estimation.rigid.regression import smooth


@dataclass(frozen=True, eq=False)
class Hole:
    """Samples that are not known, (n_sample,): whose they are, in what state, and what to do."""

    what: str
    state: str
    where: BoolArray
    remedy: str


@dataclass(frozen=True, eq=False)
class Samples:
    """Channels of a file, each (n_sample, n_axis), NaN in holes; voltages are still voltages."""

    file: str
    values: dict[str, FloatArray]
    sample_time_s: float
    holes: tuple[Hole, ...] = ()
    notes: tuple[str, ...] = field(default=())
    """What was done to them, for a warning."""
    resampled: bool = False
    """Whether they lie on another grid than the rows of the file: then nothing is held from sample to sample."""
    scalars: Mapping[str, float] = field(default_factory=dict)
    """Single numbers of the file that are constants of its experiments."""

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(next(iter(self.values.values())))

    def filtered(self, low_pass_hz: float, order: int) -> Samples:
        """Return them behind a low-pass, forward and backward, each piece between holes on its own.

        A piece that is too short for the filter becomes a hole.
        """
        known = np.ones(len(self), dtype=bool)
        for hole in self.holes:
            known &= ~hole.where
        cuts = np.flatnonzero(known[1:] != known[:-1]) + 1
        short = np.zeros(len(self), dtype=bool)
        values = {name: one.copy() for name, one in self.values.items()}
        for first, stop in zip([0, *cuts], [*cuts, len(self)], strict=True):
            if not known[first]:
                continue
            if stop - first <= 3 * order:
                short[first:stop] = True
                continue
            for one in values.values():
                covered = ~np.isnan(one).all(axis=0)
                one[first:stop, covered] = smooth(
                    one[first:stop, covered], self.sample_time_s, low_pass_hz, order
                )
        holes = self.holes
        if short.any():
            for one in values.values():
                one[short] = np.nan
            holes = (
                *holes,
                Hole("filter", "lie between holes too near for it", short, "leave filter out"),
            )
        return replace(self, values=values, holes=holes)

    def first_hole(self, kept: slice) -> str:
        """Say what is missing in a window first, how much of it, and where; empty where nothing is."""
        inside = [(hole, hole.where[kept]) for hole in self.holes if hole.where[kept].any()]
        if not inside:
            return ""
        hole, where = min(inside, key=lambda one: int(np.argmax(one[1])))
        number = kept.start + int(np.argmax(where))
        return (
            f"{hole.what}: {int(where.sum())} of {len(where)} samples {hole.state}, the first after "
            f"{number * self.sample_time_s:.4g} s at sample {number}; {hole.remedy}, or set gaps: split (the pieces "
            "between them become experiments) or mask (for stages that take holes)"
        )

    def window(
        self,
        kept: slice,
        channels: Mapping[str, ChannelMap],
        axis_names: tuple[str, ...],
        n_per_period: int | None,
    ) -> tuple[dict[str, FloatArray], BoolArray]:
        """Return the samples of an experiment, (n_sample, n_axis) each, and which are known.

        Delays are undone, and what held torques are between samples is counted.

        Parameters
        ----------
        kept
            The experiment.
        channels, axis_names
            The channel map and the robot's axes.
        n_per_period
            Samples of a period, of which the window has whole ones: what repeats is moved exactly. None: nothing
            repeats, and samples next to a hole or an end of the file are lost by a delay.
        """
        values: dict[str, FloatArray] = {}
        known = np.ones(kept.stop - kept.start, dtype=bool)
        for hole in self.holes:
            known &= ~hole.where[kept]
        whole = known.all()
        for name, channel in channels.items():
            given = self.values[name]
            covered = ~np.isnan(given).all(axis=0)
            delay = np.zeros(len(axis_names))
            names = channel.axes or axis_names
            delay[[axis_names.index(one) for one in names]] = channel.per_axis(name, "delay_s", len(names))
            delay /= self.sample_time_s
            held = channel.held_s / self.sample_time_s
            if held > 1 + 1e-3:  # clocks differ
                raise DataRejected(
                    f"channels.{name}.held_s: {channel.held_s:g} s is longer than a sample of "
                    f"{self.sample_time_s:g} s, of which each shows what was held: leave held_s "
                    "out, and state torque_hold: zero_order_hold"
                )
            if not (delay.any() or held):
                values[name] = given[kept]
                continue
            if n_per_period is not None and whole:
                moved = np.full((kept.stop - kept.start, len(axis_names)), np.nan)
                moved[:, covered] = moved_back_periodic(given[kept][:, covered], delay[covered], held)
                values[name] = moved
                continue
            margin = int(np.ceil(np.abs(delay).max())) + REACH
            first, stop = max(kept.start - margin, 0), min(kept.stop + margin, len(given))
            moved, certain = moved_back(given[first:stop], delay, held)
            inside = slice(kept.start - first, kept.stop - first)
            values[name], known = moved[inside], known & certain[inside]
        for name, channel in channels.items():
            if channel.voltage is not None:
                n_covered = len(channel.axes or axis_names)
                values[name] = torque_from_voltage(
                    values[name], channel.voltage, values, self.sample_time_s, n_covered
                )
        for one in values.values():
            known &= np.isfinite(one[:, ~np.isnan(one).all(axis=0)]).all(axis=1)
        if not known.all():
            if not known.any():
                raise DataRejected(f"no sample of {self.file} is known in all channels")
            values = {name: np.where(known[:, None], one, np.nan) for name, one in values.items()}
        return values, known
