"""Where the numbers of a robot file stand, and what they are: names, kinds, groups and units.

A place is found once for a structure (which bodies, drives and effects there are) and holds for every robot of that
structure; what changes from robot to robot are the values, and those are read at the place.

Groups are those of the thesis (section 3.1.1): *static* parameters are known from drawings and data sheets, *separate*
ones can be measured one by one (friction, sensors), *dynamic* ones only together, from motion (springs, dampers).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from robid_core.robot.file.description import RobotDescription
from robid_core.yaml_file.problems import KeyPath

STATIC, SEPARATE, DYNAMIC = "static", "separate", "dynamic"
MOMENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}

_AXIS = (
    # (pattern, {} is the axis; kind; group; unit; path inside the entry of `axes`)
    ("gear_stiffness.{}", "stiffness", DYNAMIC, "N m/rad", ("gear", "stiffness")),
    ("gear_damping.{}", "damping", DYNAMIC, "N m s/rad", ("gear", "damping")),
    ("rotor_inertia.{}", "inertia", STATIC, "kg m^2", ("rotor_inertia",)),
    ("torque_constant.{}", "drive", SEPARATE, "N m/A", ("torque_constant",)),
    ("friction.{}.coulomb", "friction", SEPARATE, "N m", ("friction", "coulomb")),
    ("friction.{}.viscous", "friction", SEPARATE, "N m s/rad", ("friction", "viscous")),
    ("friction.{}.offset", "friction", SEPARATE, "N m", ("friction", "offset")),
    ("friction.{}.speed", "friction", SEPARATE, "rad/s", ("friction", "speed")),
    ("torque_limit.{}", "drive", STATIC, "N m", ("torque_limit",)),
    ("controller.{}.speed_gain", "controller", STATIC, "N m s/rad", ("controller", "speed_gain")),
    ("controller.{}.integral_gain", "controller", STATIC, "N m/rad", ("controller", "integral_gain")),
    ("controller.{}.position_gain", "controller", STATIC, "1/s", ("controller", "position_gain")),
    ("controller.{}.speed_feedforward", "controller", STATIC, "1", ("controller", "speed_feedforward")),
    ("servo.{}.duty_gain", "controller", STATIC, "1/rad", ("servo", "duty_gain")),
    ("servo.{}.supply_voltage", "drive", STATIC, "V", ("servo", "supply_voltage")),
    ("servo.{}.resistance", "drive", SEPARATE, "ohm", ("servo", "resistance")),
    ("sensors.{}.encoder_counts", "sensor", SEPARATE, "1/rad", ("sensors", "encoder_counts")),
    ("sensors.{}.position_noise", "sensor", SEPARATE, "rad", ("sensors", "position_noise")),
    ("sensors.{}.torque_noise", "sensor", SEPARATE, "N m", ("sensors", "torque_noise")),
    ("sensors.{}.joint_position_noise", "sensor", SEPARATE, "rad", ("sensors", "joint_position_noise")),
    ("sensors.{}.joint_torque_noise", "sensor", SEPARATE, "N m", ("sensors", "joint_torque_noise")),
)
_SPRING = (
    ("bearing_stiffness.{}", "stiffness", DYNAMIC, "N m/rad", ("stiffness",)),
    ("bearing_damping.{}", "damping", DYNAMIC, "N m s/rad", ("damping",)),
)
_LINEAR_UNITS = {  # across a prismatic axis
    "N m/rad": "N/m",
    "N m s/rad": "N s/m",
    "kg m^2": "kg",
    "N m/A": "N/A",
    "N m": "N",
    "rad": "m",
    "rad/s": "m/s",
    "1/rad": "1/m",
    "1/turn": "1/(2 pi m)",
}


class TableRow(Protocol):
    """What is read of a row in an effect's table (`robid_core.effect.Parameter`)."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def default(self) -> float: ...
    @property
    def lower(self) -> float: ...
    @property
    def upper(self) -> float: ...


class ParameterPlace(NamedTuple):
    """One number of a robot file."""

    name: str
    kind: str
    """stiffness, damping, modal, inertia, friction, drive, gear, controller, sensor or effect."""
    group: str
    """static, separate or dynamic."""
    unit: str
    path: KeyPath
    """Where it stands in the description; of a moment of inertia the entry of the upper triangle."""
    row: TableRow | None = None
    """Of an effect's table."""


def places_of_structure(description: RobotDescription) -> dict[str, ParameterPlace]:
    """Return every number that has a name but for those of effects, in the order of the file."""
    found = [
        *_of_axes(description),
        *_of_springs(description),
        *_of_gears(description),
        *_of_modes(description),
        *_of_bodies(description),
    ]
    return {place.name: place for place in found}


def linear_unit(unit: str) -> str:
    """Return the unit that a number has across a prismatic axis."""
    return _LINEAR_UNITS.get(unit, unit)


def is_prismatic(description: RobotDescription, axis: str | None) -> bool:
    """Whether there is an axis of that name whose joint slides."""
    if axis is None or axis not in description.axes:
        return False
    joint = description.axes[axis].joint or axis
    return any(body.joint == joint and body.type == "prismatic" for body in description.bodies)


def motor_slides(description: RobotDescription, axis: str | None) -> bool:
    """Whether the motor of an axis slides with its joint, as a linear motor does: what is at the motor has m and N.

    A screw has a ratio, motor rad per metre of the joint: its motor turns. So does every motor of coupled gears.
    """
    if axis is None or not is_prismatic(description, axis) or description.coupling is not None:
        return False
    return abs(description.axes[axis].gear_ratio) == 1.0


def _of_axes(description: RobotDescription) -> list[ParameterPlace]:
    found = []
    joint_slides = {name for name in description.axes if is_prismatic(description, name)}
    motor_too = {name for name in joint_slides if motor_slides(description, name)}
    for pattern, kind, group, unit, path in _AXIS:
        for name, axis in description.axes.items():
            if getattr(axis, path[0]) is None:
                continue
            slides = name in (joint_slides if path[0] == "gear" else motor_too)
            here = linear_unit(unit) if slides else unit
            if path == ("sensors", "encoder_counts"):
                here = "1"  # a motor turn, or a metre
            found.append(ParameterPlace(pattern.format(name), kind, group, here, ("axes", name, *path)))
    return found


def _of_springs(description: RobotDescription) -> list[ParameterPlace]:
    found = []
    for pattern, kind, group, unit, path in _SPRING:
        for name in description.bearings:
            found.append(ParameterPlace(pattern.format(name), kind, group, unit, ("bearings", name, *path)))
    for pattern, kind, group, unit, path in _SPRING:
        for index, body in enumerate(description.bodies):
            if body.elastic is not None:
                here = _LINEAR_UNITS[unit] if body.type == "prismatic" else unit
                where = ("bodies", index, "elastic", *path)
                found.append(ParameterPlace(pattern.format(body.joint), kind, group, here, where))
    return found


def _of_gears(description: RobotDescription) -> list[ParameterPlace]:
    """Gear ratios, or the entries of the matrix that couples axes."""
    axes = list(description.axes)
    if description.coupling is None:
        units = [
            "rad/m" if is_prismatic(description, name) and not motor_slides(description, name) else "1"
            for name in axes
        ]
        return [
            ParameterPlace(f"gear_ratio.{name}", "gear", STATIC, unit, ("axes", name, "gear_ratio"))
            for name, unit in zip(axes, units, strict=True)
        ]
    return [
        ParameterPlace(f"coupling.{joint}.{motor}", "gear", STATIC, "1", ("coupling", i, j))
        for i, joint in enumerate(axes)
        for j, motor in enumerate(axes)
    ]


def _of_modes(description: RobotDescription) -> list[ParameterPlace]:
    found = []
    for index, body in enumerate(description.bodies):
        reduced = body.flexible.reduced if body.flexible is not None else None
        for k in range(len(reduced.modes) if reduced is not None else 0):
            for kind, unit in (("stiffness", "1/s^2"), ("damping", "1/s")):
                inside: KeyPath = ("bodies", index, "flexible", "reduced", "modes", k, kind)
                name = f"modal_{kind}.{body.joint}_mode_{k + 1}"
                found.append(ParameterPlace(name, "modal", DYNAMIC, unit, inside))
    return found


def _of_bodies(description: RobotDescription) -> list[ParameterPlace]:
    """Mass, centre of mass and moments of inertia; of a flexible link the mass alone, the rest are its matrices'."""
    heavy = [(index, body) for index, body in enumerate(description.bodies) if body.mass > 0]
    found = [
        ParameterPlace(f"mass.{body.joint}", "inertia", STATIC, "kg", ("bodies", index, "mass"))
        for index, body in heavy
    ]
    for index, body in heavy:
        if body.flexible is not None:
            continue
        where: KeyPath = ("bodies", index)
        found += [
            ParameterPlace(
                f"centre_of_mass.{body.joint}.{axis}", "inertia", STATIC, "m", (*where, "centre_of_mass", i)
            )
            for i, axis in enumerate("xyz")
        ]
        found += [
            ParameterPlace(
                f"inertia.{body.joint}.{name}", "inertia", STATIC, "kg m^2", (*where, "inertia", *entry)
            )
            for name, entry in MOMENTS.items()
        ]
    return found
