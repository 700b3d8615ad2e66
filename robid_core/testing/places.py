"""Where an effect is tried: a place without a spring, and robots of one and six axes that have it."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.effect import ForceEffect, Place, SignalEffect
from robid_core.errors import ConfigurationError
from robid_core.robot import Robot
from robid_core.robot.effects import BoundEffect, place_of
from robid_core.testing.robots import example_robot

LABEL = "tried"
SPOTS = ("axis", "body", "base", "gear")
"""What a structure effect may be put on."""

PLACE_NUMBERS = (
    "stiffness", "damping", "gear_ratio", "rotor_inertia", "torque_constant", "torque_limit", "sample_time",
)  # fmt: skip
"""What a test value may say of its place, where no parameter has that name."""


def example_place(side: str, **changes: Any) -> Place:
    """Return a place of a robot with one axis where nothing is: no spring, no damper; 1 ms samples, 0.25 ms steps.

    Parameters
    ----------
    side
        Side or channel.
    changes
        Fields of `Place` with other values.
    """
    row = np.zeros(2)
    fields: dict[str, Any] = {
        "name": "axis_1",
        "axis": 0,
        "side": side,
        "label": LABEL,
        "stiffness": 0.0,
        "damping": 0.0,
        "gear_ratio": 100.0,
        "rotor_inertia": 1e-3,
        "torque_constant": 1.0,
        "torque_limit": 20.0,
        "sample_time": 1e-3,
        "step": 2.5e-4,
        "direction": row,
        "motor": row,
        "transmission": row,
        "load": row[:1],
        "motor_load": row[:1],
    }
    return Place(**fields | changes)


@functools.cache
def example_robots() -> tuple[Robot, ...]:
    """Return the example robots of one and six axes."""
    return tuple(example_robot(size) for size in (1, 6))


def places(side: str) -> Iterator[tuple[Robot, Place]]:
    """Yield one place of that side or channel in each example robot that has one."""
    for robot in example_robots():
        on: str | None = robot.axis_names[min(1, robot.n_axis - 1)]
        if side == "bearing":
            on = next(iter(robot.description.bearings), None)
        try:
            yield robot, place_of(robot, LABEL, on, side)
        except ConfigurationError:  # the robot has no such place
            continue


def with_effect(
    robot: Robot, effect: type[ForceEffect] | type[SignalEffect], parameters: FloatArray, place: Place
) -> Robot:
    """Return the robot with an effect at a place; the effect need not be registered."""
    changed = replace(robot)
    changed.__dict__["effects"] = (BoundEffect(place.label, effect, parameters, place),)
    return changed


def spots(robot: Robot, kind: str) -> tuple[str, ...]:
    """Return names of things that a structure effect may be put on: one in the middle of the arm, and the last."""
    if kind == "base":
        return ("base",)
    names = [body.joint for body in robot.description.bodies] if kind == "body" else list(robot.axis_names)
    return names[min(1, len(names) - 1)], names[-1]
