"""How a channel of a recording becomes a channel of a record: column, unit, sign, scale, side of the gear.

Nothing is guessed: a unit stands in the table below, or the user gives the scale and the unit it leads to.
Names of channels say what they hold (`motor_position`, `motor_torque`, `joint_speed`...), and a voltage that is
said to be a torque is refused.
"""

from __future__ import annotations

import difflib
import re
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, FiniteFloat, model_validator

from robid_core import DataPath, DataRejected, FloatArray, Settings

# Written unit -> (SI symbol, factor).
UNITS: dict[str, tuple[str, float]] = {
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", np.pi / 180), "turn": ("rad", 2 * np.pi),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "um": ("m", 1e-6),
    "rad/s": ("rad/s", 1.0), "deg/s": ("rad/s", np.pi / 180), "rpm": ("rad/s", 2 * np.pi / 60),
    "m/s": ("m/s", 1.0), "mm/s": ("m/s", 1e-3),
    "rad/s^2": ("rad/s^2", 1.0), "deg/s^2": ("rad/s^2", np.pi / 180), "m/s^2": ("m/s^2", 1.0),
    "N m": ("N m", 1.0), "Nm": ("N m", 1.0), "mN m": ("N m", 1e-3), "kN m": ("N m", 1e3),
    "N": ("N", 1.0), "kN": ("N", 1e3),
    "A": ("A", 1.0), "mA": ("A", 1e-3), "V": ("V", 1.0), "mV": ("V", 1e-3), "degC": ("degC", 1.0), "K": ("K", 1.0),
    "1": ("1", 1.0),
}  # fmt: skip

# Word in a channel's name -> SI symbols it may have (of a revolute or of a prismatic axis).
QUANTITIES: dict[str, tuple[str, ...]] = {
    "position": ("rad", "m"),
    "speed": ("rad/s", "m/s"),
    "acceleration": ("rad/s^2", "m/s^2"),
    "torque": ("N m", "N"),
    "current": ("A",),
    "voltage": ("V",),
    "temperature": ("degC", "K"),
}


def _one_or_many(value: Any) -> Any:
    """Let one column be written without brackets."""
    return (value,) if isinstance(value, str) else tuple(value) if isinstance(value, list) else value


class ChannelMap(Settings):
    """Where one channel comes from."""

    column: Annotated[tuple[str, ...], BeforeValidator(_one_or_many, json_schema_input_type=str | list[str])]
    """Name in the file: one of all axes (its shorter side counts the axes) or a list, one for each axis.
    `name[2]` takes row or column 2 of a table, counted from 0."""
    unit: str
    """Unit in the file: rad, deg, m, mm, rad/s, rpm, N m, N, A, V...; any other needs `scale` and `unit_to`."""
    unit_to: str = ""
    """Unit after multiplication by `scale`, where the factor changes the quantity (V to N, counts to rad)."""
    scale: FiniteFloat | tuple[FiniteFloat, ...] = 1.0
    """Factor on every value, or a list with one for each axis."""
    sign: Literal[1, -1] | tuple[Literal[1, -1], ...] = 1
    """-1 where the file counts against the axis of the robot's model; one for all axes, or a list."""
    side: Literal["motor", "joint"] = "motor"
    """Side of the gear on which the file states the values."""
    file: DataPath | None = None
    """File of this channel, where it is not the stage's."""
    axes: tuple[str, ...] = ()
    """Axes that the channel covers, where it is not all of them; the others have no value."""

    @model_validator(mode="after")
    def _units_are_known(self) -> ChannelMap:
        if not np.all(self.scale):
            raise ValueError("scale must not be 0")
        if self.unit_to and self.unit_to not in {symbol for symbol, _ in UNITS.values()}:
            raise ValueError(f"unit_to '{self.unit_to}' is not one of {', '.join(_symbols())}")
        if not self.unit_to and self.unit not in UNITS:
            near = difflib.get_close_matches(self.unit, UNITS, n=1)
            hint = f"did you mean '{near[0]}'?" if near else "give scale and unit_to"
            raise ValueError(f"unit '{self.unit}' is not known; {hint}")
        return self

    @property
    def symbol(self) -> str:
        """SI symbol of the converted values."""
        return self.unit_to or UNITS[self.unit][0]

    def factors(self, name: str, n_covered: int) -> FloatArray:
        """What values of the file are multiplied by, (n_covered,); DataRejected where a list is not of that length."""
        for setting, value in (("scale", self.scale), ("sign", self.sign)):
            if isinstance(value, tuple) and len(value) != n_covered:
                raise DataRejected(
                    f"channels.{name}.{setting}: {len(value)} numbers for {n_covered} axes; give one for each, or one "
                    "for all"
                )
        unit = 1.0 if self.unit_to else UNITS[self.unit][1]
        return np.broadcast_to(np.multiply(self.sign, self.scale) * unit, (n_covered,))


def _symbols() -> list[str]:
    return sorted({symbol for symbol, _ in UNITS.values()})


def check_quantity(name: str, channel: ChannelMap) -> None:
    """Raise ValueError where the name of a channel promises another quantity than its unit holds."""
    for word, symbols in QUANTITIES.items():
        if word in name and channel.symbol not in symbols:
            raise ValueError(
                f"channels.{name}: {channel.symbol} is no unit of {word}; give scale and unit_to: {symbols[0]}"
            )


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
        f"the file has no column '{name}'; " + (f"did you mean '{near[0]}'?" if near else f"it has {listed}")
    )


def channel_table(
    columns: dict[str, FloatArray], name: str, channel: ChannelMap, axis_names: tuple[str, ...]
) -> FloatArray:
    """Return a channel as the file states it, shape (n_sample, n_covered), one column for each axis that it covers.

    Raises
    ------
    DataRejected
        If a column is missing or has another shape, or an axis is not the robot's.
    """
    covered = channel.axes or axis_names
    unknown = [axis for axis in covered if axis not in axis_names]
    if unknown:
        raise DataRejected(
            f"channels.{name}.axes: the robot has no axis {unknown[0]}; it has {', '.join(axis_names)}"
        )
    return _table([select(columns, column) for column in channel.column], name, len(covered))


def channel_values(
    table: FloatArray, name: str, channel: ChannelMap, axis_names: tuple[str, ...], first: int = 0
) -> FloatArray:
    """Return samples of a channel in SI units on the side where the file states it, shape (n_sample, n_axis).

    Parameters
    ----------
    table
        Samples as `channel_table` gives them.
    name, channel, axis_names
        What they are, and the robot's axes.
    first
        Number of the first of them in the file, for messages.

    Raises
    ------
    DataRejected
        If values are NaN or infinite (fault A05).
    """
    covered = channel.axes or axis_names
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        raise DataRejected(
            f"A05: channel {name} ({channel.column[min(bad[0][1], len(channel.column) - 1)]}), {covered[bad[0][1]]}: "
            f"{len(bad)} values are NaN or infinite, the first at sample {first + bad[0][0]}; cut the recording before "
            "it or repair it"
        )
    result = np.full((len(table), len(axis_names)), np.nan)
    result[:, [axis_names.index(axis) for axis in covered]] = table * channel.factors(name, len(covered))
    return result


def _table(parts: list[FloatArray], name: str, n_axis: int) -> FloatArray:
    """Stack columns, or turn one table, into (n_sample, n_axis)."""
    if len(parts) == 1 and parts[0].ndim == 2:
        rows, columns = parts[0].shape
        table = parts[0] if columns < rows else parts[0].T
    elif all(part.ndim == 1 for part in parts):
        lengths = {len(part) for part in parts}
        if len(lengths) > 1:
            raise DataRejected(f"A06: channel {name}: its columns have different lengths, {sorted(lengths)}")
        table = np.stack(parts, axis=1)
    else:
        shapes = ", ".join(str(part.shape) for part in parts)
        raise DataRejected(
            f"A06: channel {name}: expected one table or columns of one dimension, got {shapes}"
        )
    if table.shape[1] != n_axis:
        raise DataRejected(
            f"A06: channel {name} has {table.shape[1]} columns for {n_axis} axes; list one column for each axis, or "
            "name the axes it covers (axes: [...])"
        )
    result: FloatArray = table
    return result
