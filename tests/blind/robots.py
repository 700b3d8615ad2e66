"""Robots of the blind cases, of one, two and six axes: what is told, and what is true.

A drawn robot has masses, springs, rotors, friction and a controller of its own; the true one differs from what is told
as real robots do from their drawings.
"""

from __future__ import annotations

import numpy as np
from oracles.robots import changed, robot_of

from robid_core import FreeParameters, Robot

TOLD_OFF, INERTIA_OFF = 0.3, 0.01
SPREAD = {1: 0.7, 2: 0.5, 6: 0.3}  # of what is told, in powers of two; more axes carry one another
GAINS = 0.4  # likewise, of controllers
DRAWN = ("mass", "gear_stiffness", "gear_damping", "bearing_stiffness", "bearing_damping", "rotor_inertia")
INERTIAL = ("mass", "centre_of_mass", "inertia", "rotor_inertia")


def base_robot(n_axis: int) -> Robot:
    """Return the robot of so many axes that all drawn ones are like."""
    return two_axes() if n_axis == 2 else Robot.load({1: "one_axis", 6: "six_axis"}[n_axis])


def two_axes() -> Robot:
    """Return a shoulder and an elbow that move a heavy arm in a vertical plane."""
    motor = {"torque_constant": 1.0, "speed_limit": 400, "position_limits": [-2.0, 2.0]}
    sensors = {"encoder_counts": 1048576, "position_noise": 2e-5, "torque_noise": 0.01}
    shoulder = motor | {
        "gear_ratio": 110, "rotor_inertia": 1.6e-3, "torque_limit": 26, "sensors": sensors,
        "gear": {"stiffness": 1.6e5, "damping": 110}, "friction": {"coulomb": 0.6, "viscous": 3e-3, "speed": 0.5},
        "controller": {"speed_gain": 0.12, "integral_gain": 0.96},
    }  # fmt: skip
    elbow = motor | {
        "gear_ratio": 90, "rotor_inertia": 6e-4, "torque_limit": 12, "sensors": sensors,
        "gear": {"stiffness": 4e4, "damping": 26}, "friction": {"coulomb": 0.3, "viscous": 1.5e-3, "speed": 0.4},
        "controller": {"speed_gain": 0.045, "integral_gain": 0.36},
    }  # fmt: skip
    upper = {"joint": "shoulder", "axis": [0, 1, 0], "mass": 38, "centre_of_mass": [0.03, 0.01, 0.32],
             "inertia": np.diag([2.4, 2.2, 0.25])}  # fmt: skip
    lower = {"joint": "elbow", "parent": "shoulder", "axis": [0, 1, 0], "translation": [0, 0, 0.7], "mass": 17,
             "centre_of_mass": [0.02, -0.01, 0.28], "inertia": np.diag([0.7, 0.65, 0.08])}  # fmt: skip
    return robot_of(
        name="two_axes",
        gravity=[0, 0, -9.81],
        bodies=[upper, lower],
        axes={"shoulder": shoulder, "elbow": elbow},
    )


def told_robot(robot: Robot, generator: np.random.Generator) -> Robot:
    """Draw a robot of its own: other masses, springs, rotors and friction, another controller."""
    spread = SPREAD[robot.n_axis]
    values = {
        name: robot.parameter(name) * 2 ** generator.uniform(-spread, spread)
        for name in robot.layout
        if name.split(".")[0] in DRAWN or name.endswith((".coulomb", ".viscous"))
    }
    values |= {
        name: robot.parameter(name) * 2 ** generator.uniform(-GAINS, GAINS)
        for name in robot.layout
        if name.startswith("controller.") and name.endswith("_gain") and robot.parameter(name) > 0
    }
    return robot.with_parameters(values)


def true_robot(told: Robot, generator: np.random.Generator, *, exact_inertia: bool = False) -> Robot:
    """Draw the plant: springs, dampers and friction a third off, inertial numbers one percent, or exact."""
    off = [
        name
        for name in told.layout
        if told.parameter_kind(name) in ("stiffness", "damping")
        or (name.startswith("friction.") and not name.endswith("offset"))
    ]
    values = {n: told.parameter(n) * np.exp(TOLD_OFF * generator.uniform(-1, 1)) for n in off}
    if not exact_inertia:
        free = FreeParameters.of_robot(told, [n for n in told.layout if n.split(".")[0] in INERTIAL])
        values |= free.values(INERTIA_OFF * generator.standard_normal(len(free.names)))
    return told.with_parameters(values)


def without_bearing(robot: Robot, name: str) -> Robot:
    """Return a robot that lacks an elastic coordinate."""
    bearings = robot.description.model_dump(mode="json")["bearings"]
    return changed(robot, bearings={key: value for key, value in bearings.items() if key != name})
