"""The effects of a robot file bound to its coordinates: what the simulator runs and the linear model adds.

Structure effects change the description first; force and signal effects then become terms at their places. The friction
under `axes` is a term like any other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.effect import Effect, Equivalent, ForceEffect, Motion, Place, SignalEffect
from robid_core.errors import ConfigurationError
from robid_core.mechanics.friction import friction_terms
from robid_core.mechanics.static_laws import static_force, viscous_damping
from robid_core.mechanics.terms import ForceTerm, SignalTerm
from robid_core.robot.file.description import EffectEntry, RobotDescription
from robid_core.robot.file.effect_class import effect_class
from robid_core.robot.file.effect_places import lacking_place, lacking_side, sides_of
from robid_core.robot.file.named_parameters import misfits
from robid_core.robot.structure_effect import StructureEffect

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot


MANY_TURNS = 100.0  # rad


@dataclass(frozen=True, eq=False)
class BoundEffect:
    """A force or signal effect at its place in one robot."""

    label: str
    effect: type[ForceEffect] | type[SignalEffect]
    parameters: FloatArray
    place: Place


def structured(robot: Robot) -> RobotDescription:
    """Return the description with its structure effects applied in their order, and without their entries."""
    entries = robot.description.effects
    if not any(issubclass(_effect(label, entry), StructureEffect) for label, entry in entries.items()):
        return robot.description
    robot = replace(robot, description=robot.description.model_copy(update={"effects": {}}))
    for label, entry in entries.items():
        effect = _effect(label, entry)
        if not issubclass(effect, StructureEffect):
            continue
        robot = effect.apply(robot, _values(label, entry, effect), entry.on, label)
    left = {
        label: entry
        for label, entry in entries.items()
        if not issubclass(_effect(label, entry), StructureEffect)
    }
    return robot.description.model_copy(update={"effects": left})


def bound_effects(robot: Robot) -> tuple[BoundEffect, ...]:
    """Return the force and signal effects of a robot, in the order of its file.

    Raises
    ------
    ConfigurationError
        Where an effect cannot be at its place, or a parameter is out of bounds; the message names both.
    """
    found = []
    for label, entry in robot.structure.effects.items():
        effect = _effect(label, entry)
        assert issubclass(effect, ForceEffect | SignalEffect)
        sides = sides_of(effect)
        side = entry.side or sides[0]
        if wrong := lacking_side(entry.use, side, sides):
            raise ConfigurationError(f"{robot.name}: effects.{label}: {wrong}")
        place = place_of(robot, label, entry.on, side)
        found.append(BoundEffect(label, effect, _values(label, entry, effect), place))
    return tuple(found)


def force_terms(robot: Robot) -> tuple[ForceTerm, ...]:
    """Return every law that exerts a force: the motors' friction, and the force effects.

    What acts along a gear stands first: the other laws see the torque that the whole transmission passes.
    """
    d = robot.drives
    gears = robot.mechanism.spring_directions[: int(robot.mechanism.elastic_gear.sum())]
    gear: list[ForceTerm] = []
    other: list[ForceTerm] = []
    for bound in robot.effects:
        if issubclass(bound.effect, ForceEffect):
            for term in _terms(robot, bound):
                assert isinstance(term, ForceTerm)
                transmits = any(np.array_equal(term.direction, row) for row in gears)
                (gear if transmits else other).append(term)
    friction = friction_terms(robot.mechanism, d.coulomb, d.viscous, d.friction_speed, d.friction_offset)
    return (*gear, *friction, *other)


def signal_terms(robot: Robot) -> tuple[SignalTerm, ...]:
    """Return every law on a command or a measurement."""
    terms: list[SignalTerm] = []
    for bound in robot.effects:
        if issubclass(bound.effect, SignalEffect):
            terms += [term for term in _terms(robot, bound) if isinstance(term, SignalTerm)]
    return tuple(terms)


def _terms(robot: Robot, bound: BoundEffect) -> tuple[ForceTerm | SignalTerm, ...]:
    """Return the laws of an effect, bound once."""
    known = robot.terms_of_effects
    if bound.label not in known:
        known[bound.label] = tuple(bound.effect.bind(bound.parameters, bound.place))
    return known[bound.label]


def place_of(robot: Robot, label: str, on: str | None, side: str) -> Place:
    """Return the rows and numbers of a place.

    Raises ConfigurationError where the robot has no such axis or bearing, or nothing elastic there.
    """
    mechanism, drives, description = robot.mechanism, robot.drives, robot.structure
    n, unit = mechanism.n_coordinate, np.eye(mechanism.n_coordinate)
    springs = dict(zip(robot.spring_names, mechanism.spring_directions, strict=True))
    stiffness, damping = robot.spring_arrays()
    numbers = dict(zip(robot.spring_names, zip(stiffness, damping, strict=True), strict=True))
    if on is None and robot.n_axis == 1:
        on = robot.axis_names[0]
    if lacking := lacking_place(description, on, side):
        raise ConfigurationError(f"{robot.name}: effects.{label}: {lacking}")
    if side == "bearing":
        spring = f"bearing_stiffness.{on}"
        bearing = description.bearings.get(str(on))
        driven = [axis.joint or name for name, axis in description.axes.items()]
        axis = driven.index(bearing.joint) if bearing is not None and bearing.joint in driven else 0
        direction = springs[spring]
    else:
        axis, spring = robot.axis_names.index(str(on)), f"gear_stiffness.{on}"
        direction = {
            "gear": springs.get(spring, np.zeros(n)),
            "arm": mechanism.constraint_map[mechanism.arm[axis]],
        }.get(side, unit[axis])
    joint_row = np.eye(robot.n_axis)[axis]
    motor_load = drives.gear[:, axis]
    load = np.zeros(robot.n_axis) if side == "bearing" else (motor_load if side == "motor" else joint_row)
    at_spring = side in ("gear", "bearing")
    return Place(
        name=str(on),
        axis=axis,
        side=side,
        label=label,
        stiffness=float(numbers[spring][0]) if at_spring else 0.0,
        damping=float(numbers[spring][1]) if at_spring else 0.0,
        gear_ratio=float(1.0 / drives.gear[axis, axis]) if drives.gear[axis, axis] else np.inf,
        rotor_inertia=float(drives.rotor_inertia[axis]),
        torque_constant=float(drives.torque_constant[axis]),
        torque_limit=drives.description.axes[robot.axis_names[axis]].torque_limit,
        sample_time=robot.sample_time_s,
        step=robot.step_s,
        direction=direction.copy(),
        motor=unit[axis],
        transmission=springs.get(f"gear_stiffness.{robot.axis_names[axis]}", np.zeros(n)).copy(),
        load=np.array(load),
        motor_load=np.array(motor_load),
    )


def added_terms(
    robot: Robot, position: FloatArray, motor_speed: tuple[FloatArray, FloatArray] | None
) -> Equivalent:
    """Stiffness and damping matrices that the force effects behind the motors add, (..., n_coordinate, n_coordinate).

    Springs have their slope at the rest position; friction has its viscous part, and where the motors' speeds are given
    what sits on the arm is linearised under those of the joints.
    """
    n = position.shape[-1]
    rows = position.reshape(-1, n)
    stiffness = static_force(robot.bending_forces, rows).stiffness
    on_arm = {b.label for b in robot.effects if b.place.side == "arm"} if motor_speed is not None else set()
    damping = viscous_damping([term for term in robot.bending_forces if term.label not in on_arm], rows)
    for bound in robot.effects:
        if not issubclass(bound.effect, ForceEffect) or bound.label not in on_arm:
            continue
        assert motor_speed is not None
        rms, sine = (np.broadcast_to(v, (*position.shape[:-1], robot.n_axis)) for v in motor_speed)
        gear, direction = robot.drives.gear[bound.place.axis], bound.place.direction
        motion = Motion(
            velocity_rms=np.sqrt(rms.reshape(len(rows), -1) ** 2 @ gear**2),
            sine_speed=sine.reshape(len(rows), -1) @ abs(gear),
            position_bias=rows @ direction,
        )
        gain = bound.effect.linearize(bound.parameters, bound.place, motion).damping
        damping += np.broadcast_to(gain, len(rows))[:, None, None] * np.outer(direction, direction)
    shape = (*position.shape[:-1], n, n)
    return Equivalent(stiffness.reshape(shape), damping.reshape(shape))


def channel_gain(robot: Robot, channel: str, omega: FloatArray, last: str | None = None) -> ComplexArray:
    """Product of the complex gains of the signal effects on a channel, up to the one called `last`, (n_freq, n_axis).

    Waves of the motor angle (ripple, resolver) average out: a slow sine takes the motor over many of them.
    """
    motion = Motion(position_rms=MANY_TURNS)
    total = np.ones((len(omega), robot.n_axis), dtype=np.complex128)
    for bound in robot.effects:
        if issubclass(bound.effect, SignalEffect) and bound.place.side == channel:
            total[:, bound.place.axis] *= bound.effect.gain(bound.parameters, bound.place, omega, motion)
        if bound.label == last:
            break
    return total


def motor_viscosity(robot: Robot) -> FloatArray:
    """Viscous part of all friction at the motors, N m s/rad, shape (n_axis,)."""
    rows = np.zeros((1, robot.mechanism.n_coordinate))
    forces = [bound for bound in robot.effects if issubclass(bound.effect, ForceEffect)]
    there = [
        term
        for bound in forces
        for term in _terms(robot, bound)
        if isinstance(term, ForceTerm) and not term.coordinate[robot.n_axis :].any()
    ]
    damping: FloatArray = viscous_damping(there, rows)[0].diagonal()[: robot.n_axis].copy()
    return damping + robot.drives.viscous


def motor_damping(
    robot: Robot,
    speed_rms: FloatArray,
    slow_sine_speed: FloatArray,
    frequency_hz: npt.ArrayLike | None = None,
) -> FloatArray:
    """Viscous gain that the force effects on the motors' side add under a measured motion, shape (..., n_axis).

    That of laws with memory at the geometric mean of `frequency_hz` above zero; ConfigurationError where there is none.
    """
    lines = np.asarray([] if frequency_hz is None else frequency_hz, dtype=np.float64)
    lines = lines[lines > 0]
    omega = 2 * np.pi * np.exp(np.mean(np.log(lines))) if lines.size else 0.0
    total = np.zeros(np.broadcast_shapes(np.shape(speed_rms), np.shape(slow_sine_speed)))
    for bound in robot.effects:
        if issubclass(bound.effect, ForceEffect) and bound.place.side == "motor":
            axis = bound.place.axis
            motion = Motion(
                velocity_rms=np.asarray(speed_rms)[..., axis],
                sine_speed=np.asarray(slow_sine_speed)[..., axis],
                omega=omega,
            )
            total[..., axis] += bound.effect.linearize(bound.parameters, bound.place, motion).damping
    return total


def _effect(label: str, entry: EffectEntry) -> type[Effect]:
    try:
        return effect_class(entry.use)
    except ConfigurationError as error:
        raise ConfigurationError(f"effects.{label}: {error}") from error


def _values(label: str, entry: EffectEntry, effect: type[Effect]) -> FloatArray:
    wrong = misfits(entry.use, entry.with_, effect.parameters)
    if wrong:
        raise ConfigurationError(
            "\n".join(f"effects.{label}.with.{name}: {reason}" for name, reason in wrong.items())
        )
    return np.array([entry.with_.get(row.name, row.default) for row in effect.parameters], dtype=np.float64)
