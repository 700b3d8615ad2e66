"""Candidates: every effect of the catalogue at every place that it allows, with values to begin from.

How a parameter is searched is told by its effect where that says it (`regressor`: the law is linear in it), and by its
unit and the motion where it says nothing: orders are counted through, phases come as sine and cosine, speeds and gaps
are shares of what is moved through, angles that may have either sign lie where the axis was, levels follow the friction
that is told. An effect of a stranger needs no more.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import (
    ConfigurationError,
    Effect,
    FloatArray,
    ForceEffect,
    Parameter,
    Place,
    PluginError,
    Robot,
    SignalEffect,
)
from robid_core.residual import BoundEffect, effect_class, effect_names, place_in
from robid_diagnosis.hypothesis import ZERO_SPEEDS

LABEL = "candidate"
EVERY_ORDER = 16  # whole orders of a turn are all tried up to this one
ORDERS = (*(float(order) for order in range(1, EVERY_ORDER + 1)), 18.0, 20.0, 24.0)
SPEEDS = (0.15, 0.5, 1.5)  # of the rms speed
GAPS = (0.01, 0.04, 0.15, 0.5)  # of the deflection that is hardly exceeded, both ways
WAYS = (0.01, 0.1, 1.0)  # of the rms position: until a law with memory slides
WIDTHS = (0.5, 2.0)  # of the rms position: within what a law of the angle acts
MOST_POSES = 48  # where a law of the angle may act
LIMITS = (0.7, 0.85, 0.95)  # of the largest signal
TIMES = (0.5, 2.0)  # samples
SEEN = 0.02  # of the torque limit: friction where none is told
HARDLY = 0.98  # quantile of a deflection
BOTH_SPRINGS = ("gear", "bearing")
BEHIND = (*BOTH_SPRINGS, "arm")  # the gear


@dataclass(frozen=True)
class Spot:
    """A place for an effect: axis or bearing, and side or channel."""

    on: str
    side: str


@dataclass(frozen=True, eq=False)
class Scales:
    """Typical sizes of the motion at a place."""

    speed: float
    """Rms, rad/s."""
    position: float
    """Rms about the mean of each experiment, rad."""
    deflection: float
    """Hardly exceeded, rad."""
    signal: float
    """Largest size."""
    level: float
    """Of a friction torque, N m."""
    friction_speed: float
    """Zero-speed width that is told, rad/s at the place."""
    sample_time: float
    orders: tuple[float, ...] = ORDERS
    """Of waves of the angle, periods a turn."""
    poses: tuple[float, ...] = ()
    """Angles that were visited, an rms position apart, rad; none at a spring or for a signal."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect at a place, with the values about which it is tried."""

    use: str
    spot: Spot
    effect: type[Effect]
    values: Mapping[str, float]
    place: Place | None
    """None: the robot itself is changed."""
    shape: tuple[str, ...] = ()
    """Parameters in which the law is not linear, and that a search may move."""
    signed: bool = False
    """Whether all that a law does may be turned round."""

    @property
    def is_scale(self) -> bool:
        """Whether it says by how much the scale of a channel is off: a told number, as a mass is."""
        return issubclass(self.effect, SignalEffect) and [row.unit for row in self.effect.parameters] == ["1"]

    @property
    def springs(self) -> tuple[str, ...]:
        """Stiffnesses of coordinates that a change of the robot brings: each alone gives way by a column of its own."""
        return self.shape if self.place is None else ()

    @property
    def key(self) -> tuple[str, str, str]:
        """Effect and place, whatever the values."""
        return self.use, self.spot.on, self.spot.side

    def bound(self, values: Mapping[str, float] | None = None) -> BoundEffect:
        """Return the effect at its place, with some values changed."""
        assert issubclass(self.effect, ForceEffect | SignalEffect)
        assert self.place is not None
        numbers = {**self.values, **(values or {})}
        row = np.array([numbers[parameter.name] for parameter in self.effect.parameters])
        return BoundEffect(LABEL, self.effect, row, self.place)


def catalogue(exclude: Sequence[str] = (), only: Sequence[str] = ()) -> list[str]:
    """Return the effects that are tried, by name, strangers' included; of those that ask for it only where named."""
    return [
        name
        for name in effect_names()
        if name not in exclude and (name in only if only else _is_searched(name))
    ]


def _is_searched(name: str) -> bool:
    """Whether an effect is tried unasked; one that cannot be used is, so that the search says why it failed."""
    try:
        return effect_class(name).searched
    except (ConfigurationError, PluginError):
        return True


def spots(robot: Robot, effect: type[Effect]) -> Iterator[Spot]:
    """Where an effect may sit in a robot.

    Friction at the motor; behind a gear that is elastic, which turns at another time, too, where an effect says so.
    Where bristles bend, in the gear as well: there it is hysteresis of what winds up.
    """
    if issubclass(effect, SignalEffect):
        yield from (Spot(on, channel) for channel in effect.channels for on in robot.axis_names)
    elif issubclass(effect, ForceEffect):
        first: str = effect.sides[0]
        springs = [side for side in effect.sides if side in BOTH_SPRINGS]
        if first not in BOTH_SPRINGS:
            bristles = effect.n_state and any(row.unit == "N m/rad" for row in effect.parameters)
            springs = [effect.sides[0], *(s for s in springs if s == "gear" and bristles)]
        for side in springs:
            for on in robot.structure.bearings if side == "bearing" else robot.axis_names:
                yield Spot(on, side)
        if "arm" in effect.searched_at:
            yield from (Spot(on, "arm") for on in robot.axis_names if place_in(robot, LABEL, on, "gear"))


def place_at(robot: Robot, spot: Spot) -> Place | None:
    """Return a place of a force or a signal; none where a robot lacks it (a gear that is rigid)."""
    return place_in(robot, LABEL, spot.on, spot.side)


def grid(
    effect: type[Effect], linear: Sequence[str], scales: Scales, start: Mapping[str, float] | None = None
) -> list[dict[str, float]]:
    """Values to begin from: products of those of each parameter in which the law is not linear, and of no start."""
    rows = effect.parameters
    wave = {"order", "phase"} <= {row.name for row in rows}
    if wave:
        linear = [row.name for row in rows if row.name not in ("order", "phase", *ZERO_SPEEDS)]
    levels = [row for row in rows if row.unit == "N m" and row.name not in linear]
    told = start or {}
    choices = [
        [told[row.name]] if row.name in told else _choices(row, row.name in linear, levels, scales)
        for row in rows
    ]
    names = [row.name for row in rows]
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*choices)]


def _choices(row: Parameter, linear: bool, levels: Sequence[Parameter], scales: Scales) -> list[float]:
    """Values of one parameter, within its bounds."""
    found: list[float]
    if linear:
        found = [row.default]
    elif row.name in ZERO_SPEEDS and row.unit == "rad/s":
        found = [scales.friction_speed]
    elif row.unit == "rad/s":
        found = [share * scales.speed for share in SPEEDS]
    elif row.unit == "1/turn":
        found = list(scales.orders)
    elif row.unit == "rad" and row.name != "phase" and (scales.poses or row.default > 0):
        found = _angles(row, scales)
    elif row.unit == "s" and row.upper <= 1.0 and row.default > 0:
        found = [share * scales.sample_time for share in TIMES]
    elif row.unit == "N m" and levels:
        size = row.default / levels[0].default if levels[0].default else 1.0
        found = [size * scales.level]
        if scales.signal:
            found = [share * size * scales.signal for share in LIMITS]
    elif row.unit == "N m/rad" and levels:
        found = [scales.level / (share * scales.position) for share in WAYS]
    else:
        found = [row.default]
    clipped = np.clip(found, row.lower, row.upper)
    return list(dict.fromkeys(clipped.tolist()))


def _is_pose(row: Parameter, effect: type[Effect]) -> bool:
    """Whether a number may be the angle of an axis where a law acts."""
    on_axis = issubclass(effect, ForceEffect) and effect.sides[0] not in BOTH_SPRINGS
    return on_axis and row.unit == "rad" and row.lower < 0 < row.upper


def _angles(row: Parameter, scales: Scales) -> list[float]:
    """Values of an angle: a gap of a spring, or where and within what a law of the axis' angle acts."""
    if not scales.poses:
        return [2 * share * scales.deflection for share in GAPS]
    if row.lower < 0 < row.upper:
        return list(scales.poses)
    return [share * scales.position for share in WIDTHS] if row.default > 0 else [row.default]


def shape_of(effect: type[Effect], linear: Sequence[str], side: str = "motor") -> tuple[str, ...]:
    """Parameters that a search may move: not linear, no phase, free to vary between bounds, begun from the motion.

    Also angles that may have either sign where a law acts on the axis' angle; at zero nothing moves them. And, behind
    a gear, the zero-speed width: that of a motor's friction is told and fitted, of an arm's nobody knows anything.
    """
    if {"order", "phase"} <= {row.name for row in effect.parameters}:
        return ("order",)
    units = ["rad/s", "1/turn", "rad", "s", "N m/rad"] + ["N m"] * issubclass(effect, SignalEffect)
    held = (*linear, "phase", *(() if side == "arm" else ZERO_SPEEDS))
    return tuple(
        row.name
        for row in effect.parameters
        if row.name not in held and row.unit in units and (row.default > 0 or _is_pose(row, effect))
    )


def scales_at(
    robot: Robot,
    place: Place,
    position: FloatArray,
    speed: FloatArray,
    signal: FloatArray | None,
    friction_speed: float,
    largest_torque: float,
    orders: tuple[float, ...] = ORDERS,
) -> Scales:
    """Return what the motion at a place is like.

    Parameters
    ----------
    robot, place
        Where.
    position, speed
        Of the coordinate that the law sees, (n_lane, n_time).
    signal
        Of the channel; None: the place has none.
    friction_speed
        Zero-speed width of the motor's friction, rad/s.
    largest_torque
        Of the motor as recorded, N m, for a robot file that tells no limit.
    orders
        Of waves of the motor's angle.
    """
    swing = position - position.mean(axis=1, keepdims=True)
    axis, drives = place.axis, robot.drives
    ratio = place.gear_ratio if place.side in BEHIND else 1.0
    told = max(float(drives.coulomb[axis]), SEEN * (place.torque_limit or largest_torque))
    at_spring = place.side in BOTH_SPRINGS
    deflection = float(np.quantile(np.abs(position), HARDLY))
    return Scales(
        speed=float(np.sqrt((speed**2).mean())),
        position=float(np.sqrt((swing**2).mean())),
        deflection=deflection,
        signal=0.0 if signal is None else float(np.abs(signal).max()),
        level=0.1 * place.stiffness * deflection if at_spring else told * ratio,
        friction_speed=friction_speed / ratio,
        sample_time=place.sample_time,
        orders=orders,
        poses=()
        if at_spring or signal is not None
        else _visited(position, float(np.sqrt((swing**2).mean()))),
    )


def _visited(position: FloatArray, apart: float) -> tuple[float, ...]:
    """Angles that lanes, (n_lane, n_time), were at, so far apart or so much farther that MOST_POSES are enough."""
    lowest = float(position.min())
    cell = apart or 1.0
    while len(found := np.unique(np.floor((position - lowest) / cell))) > MOST_POSES:
        cell *= 1.25
    return tuple((lowest + (found + 0.5) * cell).tolist())
