"""What a parameter of an effect changes along a motion: the columns by which fits and diagnoses see it.

Where the law is linear in the parameter (`regressor`) the column is exact and holds for every value; elsewhere it is
the difference of the law run twice along the motion. Both are at the given motion and loads: for a law at a motor whose
motion is measured that is all there is; what a law behind the motors does to the motion comes from its transfer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.effect import ForceEffect
from robid_core.errors import ConfigurationError
from robid_core.mechanics.law_along import law_along, signal_along
from robid_core.mechanics.terms import CHANNELS, TORQUE, ForceTerm, SignalTerm
from robid_core.robot.effects import BoundEffect
from robid_core.robot.forces_along import ForceAlong, ForcesAlong, RobotMotion, forces_along

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

Terms = tuple[ForceTerm | SignalTerm, ...]

DIFFERENCE = 1e-4  # of the parameter's size, to either side


@dataclass(frozen=True, eq=False)
class EffectColumn:
    """Derivative of what an effect does, for one parameter."""

    name: str
    """Of the parameter, `effect.<label>.<name>`."""
    channel: str
    """"force", or the channel of a signal: torque (commanded to acting), position, torque_measurement."""
    direction: FloatArray
    """Over the generalised coordinates, (n_coordinate,): where it acts. A motion takes this times `values` more; of a
    signal it is the motor of the channel."""
    values: FloatArray
    """Force, or signal, per unit of the parameter, (n_lane, n_sample)."""
    linear: bool
    """Whether the column holds for every value of the parameter."""


def effect_columns(robot: Robot, names: Iterable[str], motion: RobotMotion) -> tuple[EffectColumn, ...]:
    """Return the columns of some parameters of effects; an effect of several laws has one for each.

    Parameters
    ----------
    robot
        With the values about which the columns are taken.
    names
        Of parameters of force and signal effects, `effect.<label>.<name>`.
    motion
        Of the robot; laws on signals need its torques.

    Raises
    ------
    ConfigurationError
        Where a name is no parameter of such an effect, or the motion lacks what a law asks for.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> sizes = {"coulomb": 0.2, "breakaway": 0.3}
    >>> robot = robid.Robot.load("one_axis").with_effect("rub", "friction.stribeck", "axis_1", "motor", sizes)
    >>> speed = np.linspace(-10.0, 10.0, 5)[None, :, None] * np.ones(len(robot.mechanism.coordinate_names))
    >>> motion = robid.RobotMotion(np.zeros_like(speed), speed, step=0.001)
    >>> (column,) = robid.effect_columns(robot, ["effect.rub.coulomb"], motion)
    >>> column.channel, column.linear, column.values.shape
    ('force', True, (1, 5))
    """
    asked = [_parameter(robot, name) for name in names]
    exerting = {bound.label for bound, _ in asked if issubclass(bound.effect, ForceEffect)}
    along = forces_along(robot, motion, exerting) if exerting else ForcesAlong(motion.position[..., :0], ())
    found: list[EffectColumn] = []
    for bound, row in asked:
        if issubclass(bound.effect, ForceEffect):
            found += _of_force(bound, row, along.of(bound.label), motion)
        else:
            found.append(_of_signal(bound, row, motion))
    return tuple(found)


def _parameter(robot: Robot, name: str) -> tuple[BoundEffect, str]:
    """Return the effect that a parameter is of, and its name in the effect's table."""
    place = robot.layout.get(name)
    if place is not None and place.row is not None:
        for bound in robot.effects:
            if bound.label == place.path[1]:
                return bound, place.row.name
    raise ConfigurationError(
        f"{robot.name}: '{name}' is no parameter of a law on forces or signals: it has no column along a motion"
    )


def _of_force(
    bound: BoundEffect, row: str, seen: tuple[ForceAlong, ...], motion: RobotMotion
) -> list[EffectColumn]:
    name = f"effect.{bound.label}.{row}"
    if len(seen) == 1:
        (one,) = seen
        at = one.position, one.velocity, one.load
        unit = bound.effect.regressor(*at, bound.parameters, bound.place)
        if row in unit:
            return [EffectColumn(name, "force", one.term.direction, unit[row], linear=True)]
    low, high, distance = _ends(bound, row)
    columns = []
    for force, before, after in zip(seen, low, high, strict=True):
        assert isinstance(before, ForceTerm)
        assert isinstance(after, ForceTerm)
        first, second = (
            law_along(term, force.position, force.velocity, force.load, motion.step, settle=motion.settle)
            for term in (before, after)
        )
        change = (second.force - first.force) / distance
        columns.append(EffectColumn(name, "force", force.term.direction, change, linear=False))
    return columns


def _of_signal(bound: BoundEffect, row: str, motion: RobotMotion) -> EffectColumn:
    name, place = f"effect.{bound.label}.{row}", bound.place
    angle, speed = (values @ place.motor for values in (motion.position, motion.speed))
    if place.side == "position":
        signal = angle
    elif motion.torque is not None:
        signal = motion.torque[..., place.axis]
    else:
        raise ConfigurationError(f"'{name}' acts on torques: give the motion the torque of the motors")
    unit = bound.effect.regressor(signal, angle, speed, bound.parameters, place)
    if row in unit:
        return EffectColumn(name, place.side, place.motor, unit[row], linear=True)
    low, high, distance = _ends(bound, row)
    step = place.step if place.side == CHANNELS[TORQUE] else place.sample_time
    if abs(motion.step / step - 1) > 1e-6:
        raise ConfigurationError(f"'{name}' is of a law that runs every {step:g} s: give the motion there")
    first, second = (
        signal_along(term, signal, angle, speed, motion.step, settle=motion.settle)
        for term in (*low, *high)
        if isinstance(term, SignalTerm)
    )
    return EffectColumn(name, place.side, place.motor, (second - first) / distance, linear=False)


def _ends(bound: BoundEffect, row: str) -> tuple[Terms, Terms, float]:
    """Return the laws with a parameter somewhat smaller and larger, and how far the two are apart."""
    index = [parameter.name for parameter in bound.effect.parameters].index(row)
    parameter, value = bound.effect.parameters[index], float(bound.parameters[index])
    span = parameter.upper - parameter.lower
    size = abs(value) or abs(parameter.default) or (0.1 * span if np.isfinite(span) else 1.0)
    ends: list[tuple[Terms, float]] = []
    for end in (value - DIFFERENCE * size, value + DIFFERENCE * size):
        moved = bound.parameters.copy()
        moved[index] = min(max(end, parameter.lower), parameter.upper)
        try:
            ends.append((tuple(bound.effect.bind(moved, bound.place)), moved[index]))
        except ConfigurationError:  # of two that bound one another, one is at the other
            ends.append((tuple(bound.effect.bind(bound.parameters, bound.place)), value))
    (low, lower), (high, upper) = ends
    return low, high, float(upper - lower)
