"""Flexible foundation: the robot's base rocks on the floor, or gives way sideways.

Theory: a base body of its own mass stands on springs and dampers: rocking about x and y of the base frame (anchors
and floor plate), sway along x and y (a pedestal that bends). The robot stands on it as before. A stiff robot on a
soft floor shows one more pair of resonances and antiresonances in every axis, whose torque acts on the base (Book
1993). Tied with elasticity across the first axis: only the base's own mass, and poses, tell them apart. Each
direction is a joint that no drive moves, called <label>_x and <label>_y.
"""

from __future__ import annotations

from typing import Any, Literal

from robid_core import ConfigurationError, FloatArray, Parameter, Robot, StructureEffect
from robid_effects.bodies import with_sections

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
DIRECTIONS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def on_foundation(
    robot: Robot,
    label: str,
    kind: Literal["revolute", "prismatic"],
    springs: dict[str, dict[str, float]],
    mass: float,
    height: float,
    radius: float,
) -> Robot:
    """Return the robot standing on a body of its own, elastic about or along x and y of the base frame.

    Parameters
    ----------
    springs
        Stiffness and damping for x and y, N m/rad and N m s/rad, or N/m and N s/m.
    mass, height, radius
        Of the base body, kg and m: mass, height of its centre of mass over the base frame, radius of gyration.
    """
    data: tuple[dict[str, Any], ...] = robot.description.model_dump()["bodies"]
    names = [f"{label}_{direction}" for direction in springs]
    taken = [body["joint"] for body in data if body["joint"] in names]
    if taken:
        raise ConfigurationError(
            f"effects.{label}: there is a joint '{taken[0]}' already; give another label"
        )
    base: list[dict[str, Any]] = [
        {
            "joint": name,
            "parent": parent,
            "type": kind,
            "axis": DIRECTIONS[direction],
            "elastic": springs[direction],
        }
        for name, parent, direction in zip(names, [None, *names[:-1]], springs, strict=True)
    ]
    inertia = mass * radius**2
    base[-1] |= {
        "mass": mass,
        "centre_of_mass": (0.0, 0.0, height),
        "inertia": tuple(tuple(inertia * entry for entry in row) for row in IDENTITY),
    }
    standing = [body | {"parent": body["parent"] or names[-1]} for body in data]
    return with_sections(robot, label, bodies=(*base, *standing))


def _of_the_base(on: str | None, label: str) -> None:
    if on not in (None, "base"):
        raise ConfigurationError(
            f"effects.{label}: a foundation carries the whole robot, not '{on}'; write on: base"
        )


class RockingFoundation(StructureEffect):
    """Elastic foundation on which the base turns about x and y of its frame."""

    source = "Book 1993, Controlled motion in an elastic world"
    places = ("base",)
    parameters = (
        Parameter("stiffness_x", "N m/rad", 5e6, 1.0, 1e12, "against rocking about x"),
        Parameter("stiffness_y", "N m/rad", 5e6, 1.0, 1e12, "against rocking about y"),
        Parameter("damping_x", "N m s/rad", 2e3, 0.0, 1e9, "beside it"),
        Parameter("damping_y", "N m s/rad", 2e3, 0.0, 1e9, "beside it"),
        Parameter("mass", "kg", 200.0, 0.0, 1e6, "of the base that rocks"),
        Parameter("height", "m", 0.1, -10.0, 10.0, "of its centre of mass over the base frame"),
        Parameter("radius_of_gyration", "m", 0.3, 0.0, 10.0, "of the base"),
    )

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot on a base that rocks."""
        _of_the_base(on, label)
        kx, ky, dx, dy, mass, height, radius = (float(value) for value in parameters)
        springs = {"x": {"stiffness": kx, "damping": dx}, "y": {"stiffness": ky, "damping": dy}}
        return on_foundation(robot, label, "revolute", springs, mass, height, radius)


class SwayingFoundation(StructureEffect):
    """Elastic foundation on which the base moves along x and y of its frame."""

    source = "Book 1993, Controlled motion in an elastic world"
    places = ("base",)
    parameters = (
        Parameter("stiffness_x", "N/m", 2e7, 1.0, 1e12, "against moving along x"),
        Parameter("stiffness_y", "N/m", 2e7, 1.0, 1e12, "against moving along y"),
        Parameter("damping_x", "N s/m", 1e4, 0.0, 1e9, "beside it"),
        Parameter("damping_y", "N s/m", 1e4, 0.0, 1e9, "beside it"),
        Parameter("mass", "kg", 200.0, 0.0, 1e6, "of the base that moves"),
    )

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot on a base that moves sideways."""
        _of_the_base(on, label)
        kx, ky, dx, dy, mass = (float(value) for value in parameters)
        springs = {"x": {"stiffness": kx, "damping": dx}, "y": {"stiffness": ky, "damping": dy}}
        return on_foundation(robot, label, "prismatic", springs, mass, 0.0, 0.0)
