"""How a channel of a recording becomes a channel of a record: column, unit, zero, scale, sign, delay, hold, gear side.

Nothing is guessed: a unit stands in the table below, or the user gives the scale and the unit it leads to. Values of
the file are unwrapped, less their zero, times scale, torque constant and sign, and then shifted by the delay; of a
torque that was held for less than a sample the mean over the hold is taken. Names of channels say what they hold
(`motor_position`, `motor_torque`, `joint_speed`...); a voltage that is said to be a torque is refused, and so is a
torque that a controller computed.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, FiniteFloat, NonNegativeFloat, PositiveFloat, model_validator

from robid_acquisition.unit_advice import unit_advice
from robid_core import QUANTITIES, UNITS, DataPath, DataRejected, FloatArray, Settings

# What a controller may compute, but a fit must not take for measured.
MEASURED = ("motor_position", "motor_torque")


def _one_or_many(value: Any) -> Any:
    """Let one column be written without brackets; numbers are no names."""
    entries = value if isinstance(value, list | tuple) else [value]
    if any(isinstance(entry, int | float) and not isinstance(entry, bool) for entry in entries):
        raise ValueError(
            "columns have names, no numbers: write those of the file's first line (`robid records FILE` shows them), "
            "or name[2] for column 2, counted from 0, of a table called name"
        )
    return (value,) if isinstance(value, str) else tuple(value) if isinstance(value, list) else value


Columns = Annotated[tuple[str, ...], BeforeValidator(_one_or_many, json_schema_input_type=str | list[str])]
PerAxis = FiniteFloat | tuple[FiniteFloat, ...]


def _no_sign(value: Any) -> Any:
    """Refuse torque constants with a sign: it has a setting of its own."""
    numbers = [
        one for one in (value if isinstance(value, list | tuple) else [value]) if isinstance(one, int | float)
    ]
    if any(number < 0 for number in numbers):
        signs = [-1 if number < 0 else 1 for number in numbers]
        written = signs if isinstance(value, list | tuple) else signs[0]
        raise ValueError(f"a torque constant has no sign; leave it positive and give sign: {written}")
    return tuple(value) if isinstance(value, list) else value


PositivePerAxis = PositiveFloat | tuple[PositiveFloat, ...]


def _as_enable(value: Any) -> Any:
    """Let the column alone be written."""
    return {"column": value} if isinstance(value, str | list) else value


class Enable(Settings):
    """The column that says when a drive was enabled; samples where it was not are masked."""

    column: Columns
    """Name in the file, one of all axes or a list."""
    value: FiniteFloat | None = None
    """What it holds while enabled; null: anything but 0."""


class Voltage(Settings):
    """A motor torque from the voltage of a DC drive: kt/R V - kt^2/R times the speed of the motor.

    The winding's inductance is left out: the torque is right well below R/L. The speed is that of the channel
    motor_speed, or the central difference of motor_position.
    """

    column: Columns
    """Name in the file, one of all axes or a list."""
    unit: Literal["V", "mV"] = "V"
    """Unit in the file."""
    duty: Columns = ()
    """Column of the share of the voltage that the bridge passes on, -1 to 1; left out: all of it."""
    duty_scale: FiniteFloat = 1.0
    """Factor on that column, where it counts otherwise (1/885)."""
    resistance: PositivePerAxis
    """Of the winding, ohm; one for all axes, or a list."""
    torque_constant: PositivePerAxis
    """kt in N m/A, at the motor's shaft; one for all axes, or a list."""


class ChannelMap(Settings):
    """Where one channel comes from."""

    column: Columns = ()
    """Name in the file: one of all axes (its shorter side counts the axes) or a list, one for each axis.
    `name[2]` takes row or column 2 of a table, counted from 0."""
    unit: str = ""
    """Unit in the file: rad, deg, m, mm, rad/s, rpm, N m, N, A, V...; any other needs `scale` and `unit_to`."""
    voltage: Voltage | None = None
    """In place of column and unit: a motor torque from the voltage of a DC drive."""
    wrap: PositiveFloat | None = None
    """What a counter or an angle is wrapped at, in the file's unit (4096, 360): it is unwrapped."""
    zero: PerAxis = 0.0
    """What the file states where the value is 0, in the file's unit; one for all axes, or a list."""
    unit_to: str = ""
    """Unit after multiplication by `scale`, where the factor changes the quantity (V to N, counts to rad)."""
    scale: PerAxis = 1.0
    """Factor on every value, or a list with one for each axis."""
    torque_constant: Annotated[PositivePerAxis | None, BeforeValidator(_no_sign)] = None
    """N m/A: makes a torque of a current; one for all axes, or a list."""
    sign: Literal[1, -1] | tuple[Literal[1, -1], ...] = 1
    """-1 where the file counts against the axis of the robot's model; one for all axes, or a list."""
    side: Literal["motor", "joint"] = "motor"
    """Side of the gear on which the file states the values."""
    hold: bool = False
    """Whether a value holds until the next one, as a switch does, or what a controller was asked for: `resample` takes
    the last one then."""
    delay_s: PerAxis = 0.0
    """By how much the file states values too late, s; they are moved back. One for all axes, or a list."""
    held_s: NonNegativeFloat = 0.0
    """For how long a controller that is faster than the recording holds each torque, s (its own sampling time): the
    mean over it is what acts. Goes with `torque_hold: continuous`."""
    enable: Annotated[
        Enable | None,
        BeforeValidator(_as_enable, json_schema_input_type=str | list[str] | Enable | None),
    ] = None
    """A column that says when the drive was enabled, or {column, value}; other samples are masked."""
    computed: bool = False
    """Whether the controller computed it and did not measure it (a model's torque): kept, but no torque of a fit."""
    file: DataPath | None = None
    """File of this channel, where it is not the stage's."""
    axes: tuple[str, ...] = ()
    """Axes that the channel covers, where it is not all of them; the others have no value."""

    @model_validator(mode="after")
    def _is_whole(self) -> ChannelMap:
        if self.voltage is not None:
            given = [
                name
                for name in ("column", "unit", "unit_to", "torque_constant", "wrap", "zero")
                if getattr(self, name)
            ]
            if given or self.scale != 1.0 or self.side != "motor":
                raise ValueError(
                    f"voltage makes a torque at the motor: leave out {', '.join(given) or 'scale and side'}"
                )
            return self
        for name in ("column", "unit"):
            if not getattr(self, name):
                raise ValueError(f"{name} is missing")
        if not np.all(self.scale):
            raise ValueError("scale must not be 0")
        if self.unit_to and self.unit_to not in {symbol for symbol, _ in UNITS.values()}:
            raise ValueError(f"unit_to '{self.unit_to}' is not one of {', '.join(_symbols())}")
        if not self.unit_to and self.unit not in UNITS:
            raise ValueError(f"unit '{self.unit}' is not known; {unit_advice(self.unit)}")
        if self.torque_constant is not None and self._stated != "A":
            raise ValueError(f"torque_constant goes with a current in A, not with {self._stated}")
        return self

    @property
    def _stated(self) -> str:
        """SI symbol of the values without their torque constant."""
        return self.unit_to or UNITS[self.unit][0]

    @property
    def symbol(self) -> str:
        """SI symbol of the converted values."""
        makes_torque = self.voltage is not None or self.torque_constant is not None
        return "N m" if makes_torque else self._stated

    @property
    def read_symbol(self) -> str:
        """SI symbol of the values before a voltage becomes a torque."""
        return "V" if self.voltage is not None else self.symbol

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of its values."""
        return self.column if self.voltage is None else self.voltage.column

    def factors(self, name: str, n_covered: int) -> FloatArray:
        """What values of the file are multiplied by, (n_covered,); DataRejected where a list is not of that length."""
        if self.voltage is not None:
            return self.per_axis(name, "sign", n_covered) * UNITS[self.voltage.unit][1]
        unit = 1.0 if self.unit_to else UNITS[self.unit][1]
        constant = 1.0 if self.torque_constant is None else self.per_axis(name, "torque_constant", n_covered)
        return (
            self.per_axis(name, "sign", n_covered) * self.per_axis(name, "scale", n_covered) * unit * constant
        )

    def per_axis(self, name: str, setting: str, n_covered: int) -> FloatArray:
        """Return a setting of the channel `name` for each axis that it covers; raises as `factors`."""
        return per_axis(f"channels.{name}.{setting}", getattr(self, setting), n_covered)


def per_axis(where: str, value: float | tuple[float, ...], n_covered: int) -> FloatArray:
    """Return one number for each axis; DataRejected where a list has another length."""
    if isinstance(value, tuple) and len(value) != n_covered:
        raise DataRejected(
            f"{where}: {len(value)} numbers for {n_covered} axes; give one for each, or one for all"
        )
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (n_covered,))


def _symbols() -> list[str]:
    return sorted({symbol for symbol, _ in UNITS.values()})


def check_quantity(name: str, channel: ChannelMap) -> None:
    """Raise ValueError where the name of a channel promises another quantity than its unit holds, or a measured one."""
    for word, symbols in QUANTITIES.items():
        if word in name and channel.symbol not in symbols:
            current = word == "torque" and channel.symbol == "A"
            raise ValueError(
                f"channels.{name}: {channel.symbol} is no unit of {word}; give "
                + (
                    "torque_constant here (N m/A; that of the robot file is not taken), or "
                    if current
                    else ""
                )
                + f"scale and unit_to: {symbols[0]}"
            )
    if channel.computed and name in MEASURED:
        raise ValueError(
            f"channels.{name}: what the controller computed is not measured; keep it under another name "
            f"(model_{name}) and give the measured one, a torque as current with torque_constant"
        )
    if channel.held_s and name != "motor_torque":
        raise ValueError(
            f"channels.{name}: held_s says how long a controller holds a motor_torque, and nothing else"
        )
    if channel.voltage is not None and name != "motor_torque":
        raise ValueError(f"channels.{name}: voltage makes a motor_torque, and nothing else")
