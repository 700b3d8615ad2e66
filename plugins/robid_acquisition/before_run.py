"""What a run would refuse of recordings, found before it: from settings and robot, and from names and lengths in files.

Messages are those of the run, by the setting that they are about.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from robid_acquisition.channel_map import ChannelMap, per_axis
from robid_acquisition.channel_values import (
    covered_axes,
    refuse_other_count,
    refuse_other_lengths,
    rows_of,
    select,
)
from robid_acquisition.excited_lines import refuse_beyond_nyquist
from robid_acquisition.signals import samples_per_period
from robid_core import DataRejected, FloatArray

Place = tuple[str | int, ...]
Columns = dict[str, FloatArray]
PER_AXIS = ("sign", "scale", "zero", "delay_s", "torque_constant")
PER_AXIS_OF_VOLTAGE = ("resistance", "torque_constant")


def channel_problems(channels: Mapping[str, ChannelMap], axis_names: tuple[str, ...]) -> dict[Place, str]:
    """Messages on channels that cannot be those of a robot with these axes, whatever the files hold."""
    found: dict[Place, str] = {}
    for name, channel in channels.items():
        place: Place = ("channels", name)
        covered = tried(found, (*place, "axes"), covered_axes, name, channel, axis_names)
        if covered is None:
            continue
        for setting, value in _lists(channel):
            words = ".".join(map(str, ("channels", name, *setting)))
            tried(found, (*place, *setting), per_axis, words, value, len(covered))
        for setting, label, columns in _columns(name, channel):
            if len(columns) > 1:  # one name may be a table
                tried(found, (*place, *setting), refuse_other_count, label, len(columns), len(covered))
    return found


def period_problems(
    period_s: float | str | None, lines: Sequence[int] | str, step: float, n_sample: int | None = None
) -> dict[Place, str]:
    """Messages on a period that is none of a recording, and on lines that it cannot have.

    Parameters
    ----------
    period_s, lines
        As the settings say them.
    step
        Sampling time, s.
    n_sample
        Of the recording; None: not known.
    """
    found: dict[Place, str] = {}
    if isinstance(period_s, float):
        there = max(round(period_s / step), 1) if n_sample is None else n_sample
        per_period = tried(found, ("period_s",), samples_per_period, there, step, period_s)
        if per_period is not None and not isinstance(lines, str):
            tried(found, ("lines",), refuse_beyond_nyquist, lines, per_period)
    return found


def column_problems(
    channels: Mapping[str, ChannelMap], arrays: Mapping[str, Columns], axis_names: tuple[str, ...]
) -> tuple[dict[Place, str], int]:
    """Messages on columns that the files lack or that have another shape, and how many rows there are.

    Parameters
    ----------
    channels
        Without `channel_problems`.
    arrays
        What the file of each channel holds; of channels that are left out nothing is known.
    axis_names
        Of the robot.
    """
    found: dict[Place, str] = {}
    lengths: dict[str, int] = {}
    for name, columns in arrays.items():
        n_axis = len(covered_axes(name, channels[name], axis_names))
        for setting, label, wanted in _columns(name, channels[name]):
            place: Place = ("channels", name, *setting)
            parts = [
                tried(found, (*place, number), select, columns, one) for number, one in enumerate(wanted)
            ]
            there = [part for part in parts if part is not None]
            if len(there) < len(parts) or (setting[0] == "enable" and len(there) == there[0].ndim == 1):
                continue
            n_row = tried(found, place, rows_of, there, label, n_axis)
            if n_row is not None and label == name and "duty" not in setting:
                lengths[name] = n_row
    if not found:
        tried(found, ("channels",), refuse_other_lengths, lengths)
    return found, max(lengths.values(), default=0)


def _lists(channel: ChannelMap) -> Iterator[tuple[Place, Any]]:
    """Settings that may be lists with one number for each axis, by their place in the channel."""
    for setting in PER_AXIS:
        yield (setting,), getattr(channel, setting)
    if channel.voltage is not None:
        for setting in PER_AXIS_OF_VOLTAGE:
            yield ("voltage", setting), getattr(channel.voltage, setting)


def _columns(name: str, channel: ChannelMap) -> Iterator[tuple[Place, str, Sequence[str]]]:
    """Columns that a channel takes: their place in it, what a message calls them, their names."""
    if channel.voltage is None:
        yield ("column",), name, channel.columns
    else:
        yield ("voltage", "column"), name, channel.columns
        if channel.voltage.duty:
            yield ("voltage", "duty"), name, channel.voltage.duty
    if channel.enable is not None:
        yield ("enable", "column"), f"{name}.enable", channel.enable.column


def tried(found: dict[Place, str], place: Place, check: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a check returns; None where it refuses, with its message at the place."""
    try:
        return check(*arguments)
    except DataRejected as error:
        found[place] = str(error)
        return None
