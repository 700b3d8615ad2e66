"""Values of a channel out of the named arrays of a file: the columns that it names, and what they mean in SI units."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping

import numpy as np

from robid_acquisition.channel_map import ChannelMap
from robid_acquisition.unwrapping import unwrapped
from robid_core import BoolArray, DataRejected, FloatArray


def select(columns: dict[str, FloatArray], name: str) -> FloatArray:
    """Return a column by name, or one line of a table as `name[2]`; DataRejected says what comes near."""
    if name in columns:
        return columns[name]
    part = re.fullmatch(r"(.+)\[(\d+)\]", name)
    if part and part[1] in columns and columns[part[1]].ndim == 2:
        table, index = columns[part[1]], int(part[2])
        table = table if table.shape[0] >= table.shape[1] else table.T
        if index < table.shape[1]:
            result: FloatArray = table[:, index]
            return result
        raise DataRejected(f"'{part[1]}' has {table.shape[1]} columns, counted from 0; there is no {name}")
    near = difflib.get_close_matches(name, columns, n=1)
    listed = ", ".join(list(columns)[:12]) + (", ..." if len(columns) > 12 else "")
    raise DataRejected(
        f"the file has no column '{name}' of numbers (words, dates, and arrays whose length changes are left out); "
        + (f"did you mean '{near[0]}'?" if near else f"it has {listed}")
    )


def channel_table(
    columns: dict[str, FloatArray], name: str, channel: ChannelMap, axis_names: tuple[str, ...]
) -> FloatArray:
    """Return a channel as the file states it, shape (n_row, n_covered), one column for each axis that it covers.

    A voltage is what the bridge passes on of it.

    Raises
    ------
    DataRejected
        If a column is missing or has another shape, or an axis is not the robot's.
    """
    n_covered = len(covered_axes(name, channel, axis_names))
    table = _table([select(columns, column) for column in channel.columns], name, n_covered)
    if channel.voltage is not None and channel.voltage.duty:
        duty = _table([select(columns, column) for column in channel.voltage.duty], name, n_covered)
        _same_length(table, duty, name, "duty")
        table = table * duty * channel.voltage.duty_scale
    return table


def enabled_rows(
    columns: dict[str, FloatArray], name: str, channel: ChannelMap, axis_names: tuple[str, ...]
) -> BoolArray | None:
    """Return where all axes of a channel were enabled, (n_row,); None where it does not say.

    Raises as `channel_table`.
    """
    if channel.enable is None:
        return None
    parts = [select(columns, column) for column in channel.enable.column]
    n_covered = len(covered_axes(name, channel, axis_names))
    one_for_all = len(parts) == 1 and parts[0].ndim == 1
    table = parts[0][:, None] if one_for_all else _table(parts, f"{name}.enable", n_covered)
    value = channel.enable.value
    enabled: BoolArray = ((table != 0) if value is None else (table == value)).all(axis=1)
    return enabled


def channel_values(
    table: FloatArray, name: str, channel: ChannelMap, axis_names: tuple[str, ...], instant: FloatArray
) -> FloatArray:
    """Return a channel in SI units on the side where the file states it, shape (n_row, n_axis).

    A voltage stays one. What is NaN or infinite in the file is NaN, and so is an axis that the channel does not cover.

    Parameters
    ----------
    table
        The channel as `channel_table` gives it.
    name, channel, axis_names
        What it is, and the robot's axes.
    instant
        When it was measured, in samples, (n_row,).

    Raises
    ------
    DataRejected
        If a list has another length than there are axes, or a wrapped value cannot be followed.
    """
    covered = covered_axes(name, channel, axis_names)
    known = np.where(np.isfinite(table), table, np.nan)
    if channel.wrap is not None:
        known = np.stack(
            [
                unwrapped(one, channel.wrap, instant, f"channels.{name}, {axis}")
                for one, axis in zip(known.T, covered, strict=True)
            ],
            axis=1,
        )
    result = np.full((len(table), len(axis_names)), np.nan)
    zero = channel.per_axis(name, "zero", len(covered))
    result[:, [axis_names.index(axis) for axis in covered]] = (known - zero) * channel.factors(
        name, len(covered)
    )
    return result


def covered_axes(name: str, channel: ChannelMap, axis_names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the axes that a channel covers; DataRejected for one that is not the robot's."""
    covered = channel.axes or axis_names
    unknown = [axis for axis in covered if axis not in axis_names]
    if unknown:
        raise DataRejected(
            f"channels.{name}.axes: the robot has no axis {unknown[0]}; it has {', '.join(axis_names)}"
        )
    return covered


def _same_length(table: FloatArray, other: FloatArray, name: str, what: str) -> None:
    if len(table) != len(other):
        raise DataRejected(f"A06: channel {name}: {len(table)} samples and {len(other)} of its {what}")


def rows_of(parts: list[FloatArray], name: str, n_axis: int) -> int:
    """Return how many rows columns have, or one table; DataRejected where they do not make one of `n_axis` axes."""
    if len(parts) == 1 and parts[0].ndim == 2:
        n_column, n_row = min(parts[0].shape), max(parts[0].shape)
    elif all(part.ndim == 1 for part in parts):
        lengths = {len(part) for part in parts}
        if len(lengths) > 1:
            raise DataRejected(f"A06: channel {name}: its columns have different lengths, {sorted(lengths)}")
        n_column, n_row = len(parts), len(parts[0])
    else:
        shapes = ", ".join(str(part.shape) for part in parts)
        raise DataRejected(
            f"A06: channel {name}: expected one table or columns of one dimension, got {shapes}"
        )
    refuse_other_count(name, n_column, n_axis)
    return int(n_row)


def refuse_other_count(name: str, n_column: int, n_axis: int) -> None:
    """Raise DataRejected where a channel has more or fewer columns than axes that it covers."""
    if n_column != n_axis:
        raise DataRejected(
            f"A06: channel {name} has {n_column} column{'s' * (n_column != 1)} for {n_axis} axes; list one column for "
            "each axis, or name the axes it covers (axes: [...])"
        )


def refuse_other_lengths(lengths: Mapping[str, int]) -> None:
    """Raise DataRejected where channels have different numbers of rows."""
    if len(set(lengths.values())) > 1:
        raise DataRejected(f"A06: the channels have different lengths: {dict(lengths)}")


def _table(parts: list[FloatArray], name: str, n_axis: int) -> FloatArray:
    """Stack columns, or turn one table, into (n_sample, n_axis)."""
    rows_of(parts, name, n_axis)
    if parts[0].ndim == 1:
        return np.stack(parts, axis=1)
    rows, columns = parts[0].shape
    result: FloatArray = parts[0] if columns < rows else parts[0].T
    return result
