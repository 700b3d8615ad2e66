"""What a blind case may hide, and which verdicts are then right.

A kind draws where it is, its shape, and a size of one; the size is then found that makes it as strong as a case
asks for (`strength.py`). Wrong values are kinds, too: there the right verdict is a value, not a law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from blind import laws
from blind.foreign_plant import HiddenLaw
from blind.standing import Base
from robid_core import Robot

RIGHT = {
    "friction.asymmetric": ("friction.asymmetric",),
    "friction.stribeck": ("friction.stribeck",),
    "friction.load_dependent": ("friction.load_dependent",),
    "friction.dahl": ("friction.dahl", "friction.lugre", "friction.elasto_plastic"),
    "friction.lugre": ("friction.lugre", "friction.elasto_plastic"),
    "transmission.backlash": ("transmission.backlash", "transmission.soft_zone"),
    "transmission.stiffening": ("transmission.stiffening",),
    "transmission.hysteresis": ("transmission.maxwell_slip", "transmission.bouc_wen", "friction.dahl"),
    "drive.torque_ripple": ("drive.torque_ripple", "drive.cogging"),
    "sensing.resolver_ripple": ("sensing.resolver_ripple",),
    "transmission.kinematic_error": ("transmission.kinematic_error",),
    "drive.current_loop": ("drive.current_loop",),
    "load.cable_spring": ("load.cable_spring",),
    "drive.saturation": ("drive.saturation",),
    "structure.foundation": ("structure.foundation",),
    "structure.foundation_sway": ("structure.foundation_sway",),
    "structure.elastic_coordinate": ("structure.elastic_coordinate",),
    "value.torque_constant": ("drive.torque_constant", "sensing.gain_error"),
    "value.payload": ("body",),
    "value.centre_of_mass": ("body",),
    "value.rotor_inertia": ("rotor",),
    "value.stiffness": ("spring",),
}
"""Names that are right: a law and its special cases."""

OF_ONE = {
    "friction.asymmetric": 6e3,
    "friction.stribeck": 6e3,
    "friction.load_dependent": 9e4,
    "friction.dahl": 5e5,
    "friction.lugre": 4e5,
    "transmission.backlash": 2e5,
    "transmission.stiffening": 3e6,
    "transmission.hysteresis": 1e4,
    "drive.torque_ripple": 3e4,
    "sensing.resolver_ripple": 5e4,
    "transmission.kinematic_error": 2e5,
    "drive.current_loop": 2.5e3,
    "load.cable_spring": 1e4,
    "drive.saturation": 1e3,
    "structure.foundation": 4e4,
    "structure.foundation_sway": 4e4,
    "structure.elastic_coordinate": 5e5,
}
"""Strength of a size of one, within a factor of five or so (ninety cases): where the search for a size begins."""

LAWS = tuple(kind for kind in RIGHT if not kind.startswith(("value.", "structure.")))
STRUCTURES = tuple(kind for kind in RIGHT if kind.startswith("structure."))  # of six axes
VALUES = tuple(kind for kind in RIGHT if kind.startswith("value."))

SHIFT = 0.03  # m, of a centre of mass across its joint: along it no motor of a single axis feels it

Numbers = Callable[[float], tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class Plant:
    """A true robot and what it has that no robot file says."""

    robot: Robot
    laws: tuple[HiddenLaw, ...] = ()
    base: Base | None = None


@dataclass(frozen=True, eq=False)
class Hidden:
    """One thing that is hidden, of a size yet to be chosen."""

    kind: str
    on: str
    """Axis, joint or body at which a verdict is right."""
    law: HiddenLaw | None = None
    numbers: Numbers = field(default=lambda size: ())
    """Of the law, by its size."""
    values: Callable[[float], dict[str, float]] = field(default=lambda size: {})
    """Numbers of the robot, by the size."""
    base: Callable[[float], Base | None] = field(default=lambda size: None)
    bearing: str = ""
    """Which the told robot lacks."""
    absent: float = 0.0
    """Size at which it is not there."""

    def added(self, plant: Plant, size: float) -> Plant:
        """Return a plant that has it, too."""
        robot = plant.robot.with_parameters(self.values(size))
        more = () if self.law is None else (replace(self.law, numbers=self.numbers(size)),)
        return Plant(robot, (*plant.laws, *more), self.base(size) or plant.base)


def hidden(kind: str, robot: Robot, generator: np.random.Generator) -> Hidden:
    """Draw one thing for a true robot: where, in which shape, and what a size of one is."""
    axis = int(generator.integers(robot.n_axis))
    name = robot.axis_names[axis]
    if kind.startswith("value."):
        return _value(kind, robot, axis, generator)
    if kind == "structure.elastic_coordinate":
        bearings = list(robot.description.bearings)
        bearing = bearings[int(generator.integers(len(bearings)))]
        stiffness = f"bearing_stiffness.{bearing}"
        joint = robot.description.bearings[bearing].joint
        told = robot.parameter(stiffness)
        return Hidden(kind, joint, values=lambda size: {stiffness: told / size}, bearing=bearing)
    if kind.startswith("structure."):
        return _base(kind, robot, generator)
    law, row, numbers = _law(kind, robot, axis, generator)
    return Hidden(kind, name, HiddenLaw(law, axis, (), row), numbers)


def _law(
    kind: str, robot: Robot, axis: int, generator: np.random.Generator
) -> tuple[int, np.ndarray, Numbers]:
    """Law, row of its coordinate, and numbers by size."""
    n = robot.mechanism.n_coordinate
    motor, gear = np.eye(n)[axis], robot.mechanism.spring_directions[axis]
    joint = robot.mechanism.constraint_map[robot.mechanism.arm[axis]]
    level = float(robot.drives.coulomb[axis])
    ratio = 1 / float(robot.drives.gear[axis, axis])
    stiffness = robot.parameter(f"gear_stiffness.{robot.axis_names[axis]}")
    order, phase = float(generator.integers(2, 13)), float(generator.uniform(0, 2 * np.pi))
    bent = 2.0 * level * ratio / stiffness  # rad, of a gear under some times its friction
    slow, power = float(generator.uniform(2, 6)), float(generator.uniform(1, 2))
    slip, yields = float(generator.uniform(40, 160)), float(generator.uniform(1.5, 4))
    rest = float(generator.uniform(-0.5, 0.5))
    found: dict[str, tuple[int, np.ndarray, Numbers]] = {
        "friction.asymmetric": (laws.ASYMMETRIC, motor, lambda s: (0.1 * s * level,)),
        "friction.stribeck": (laws.STRIBECK, motor, lambda s: (0.3 * s * level, slow, power)),
        "friction.load_dependent": (laws.BY_LOAD, motor, lambda s: (0.03 * s,)),
        "friction.dahl": (laws.DAHL, motor, lambda s: (0.3 * s * level, slip * s * level)),
        "friction.lugre": (
            laws.LUGRE, motor, lambda s: (0.3 * s * level, slip * s * level, 0.1 * s * level, 1.5),
        ),
        "transmission.backlash": (laws.BACKLASH, gear, lambda s: (0.1 * s * bent,)),
        "transmission.stiffening": (laws.STIFFENING, gear, lambda s: (0.1 * s * stiffness / bent**2,)),
        "transmission.hysteresis": (
            laws.HYSTERESIS, gear, lambda s: (0.05 * s * stiffness * bent / yields, 0.05 * s * stiffness),
        ),
        "drive.torque_ripple": (laws.RIPPLE, motor, lambda s: (0.03 * s * level, order, phase)),
        "sensing.resolver_ripple": (laws.RESOLVER, motor, lambda s: (2e-3 * s, order, phase)),
        "transmission.kinematic_error": (laws.GEAR_WAVE, gear, lambda s: (0.03 * s * bent, order, phase)),
        "drive.current_loop": (laws.LAG, motor, lambda s: (1e-3 * s,)),
        "load.cable_spring": (laws.CABLE, joint, lambda s: (20 * s, rest, 0.0)),
        "drive.saturation": (laws.SATURATION, motor, lambda s: (6.0 * level / s,)),
    }  # fmt: skip
    return found[kind]


def _base(kind: str, robot: Robot, generator: np.random.Generator) -> Hidden:
    """A base of about the robot's mass, whose springs put its resonance where arms are excited."""
    standing = sum(robot.parameter(name) for name in robot.layout if name.startswith("mass."))
    mass = float(standing * generator.uniform(0.5, 2))
    rocks = kind == "structure.foundation"
    shape, damped = generator.uniform(0.7, 1.4, 2), float(generator.uniform(2e-4, 1e-3))

    def base(size: float) -> Base:
        one, other = ((8e6 if rocks else 2e7) / size * shape).tolist()
        return Base(rocks, (one, other), (damped * one, damped * other), mass, *((0.1, 0.3) if rocks else ()))

    return Hidden(kind, "base", base=base)


def _value(kind: str, robot: Robot, axis: int, generator: np.random.Generator) -> Hidden:
    """Numbers that are told wrong: of a body, a rotor, a spring, a torque constant."""
    sign = float(generator.choice([-1, 1]))
    last = robot.description.bodies[-1].joint
    name = robot.axis_names[axis]
    mass = robot.parameter(f"mass.{last}")
    centre = np.array([robot.parameter(f"centre_of_mass.{last}.{k}") for k in "xyz"])
    rotor, spring = (f"{noun}.{name}" for noun in ("rotor_inertia", "gear_stiffness"))
    way = np.cross(robot.description.bodies[-1].axis, generator.standard_normal(3))
    way *= SHIFT / np.linalg.norm(way)
    offset = generator.uniform(-0.1, 0.1, 3)

    def loaded(size: float) -> dict[str, float]:
        """A point mass at the last body: its mass, centre and inertia (Steiner) change together."""
        share = 0.1 * size / (1 + 0.1 * size)
        moments = share * mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
        found = {f"mass.{last}": mass * (1 + 0.1 * size)}
        for i, one in enumerate("xyz"):
            found[f"centre_of_mass.{last}.{one}"] = float(centre[i] + share * offset[i])
            for j, other in enumerate("xyz"[i:], i):
                name = f"inertia.{last}.{one}{other}"
                found[name] = robot.parameter(name) + float(moments[i, j])
        return found

    if kind == "value.torque_constant":
        row = np.eye(robot.mechanism.n_coordinate)[axis]
        return Hidden(kind, name, HiddenLaw(laws.GAIN, axis, (), row), lambda size: (0.05 * sign * size,))
    if kind == "value.payload":
        return Hidden(kind, last, values=loaded)
    if kind == "value.centre_of_mass":
        return Hidden(
            kind,
            last,
            values=lambda size: {
                f"centre_of_mass.{last}.{k}": float(c)
                for k, c in zip("xyz", centre + size * way, strict=True)
            },
        )
    if kind == "value.rotor_inertia":
        told = robot.parameter(rotor)
        return Hidden(kind, name, values=lambda size: {rotor: told * np.exp(0.1 * sign * size)})
    stiff = robot.parameter(spring)
    return Hidden(kind, name, values=lambda size: {spring: stiff * np.exp(0.7 * sign * size)})
