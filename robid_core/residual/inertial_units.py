"""Inertial units on the links of a robot: their channels, where the robot file says they are, and what they show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics import InertialSensor
from robid_core.mechanics.feedforward import derivative
from robid_core.robot import Robot

RATE_BAND = 0.45  # of the sampling rate: at a sixth of it a rate errs by 1e-5 where samples are no period
ACCELERATION, TURN_RATE = "link_acceleration", "link_turn_rate"
INERTIAL = (ACCELERATION, TURN_RATE)
"""What inertial units show, each in three channels, `link_acceleration_x` to `link_turn_rate_z`."""


def channels_of(kinds: Sequence[str]) -> tuple[str, ...]:
    """Return the channels of kinds of sensors, in their order."""
    return tuple(
        f"{kind}{of_axis}"
        for kind in kinds
        for of_axis in (("_x", "_y", "_z") if kind in INERTIAL else ("",))
    )


def inertial_of(robot: Robot, axis: int) -> InertialSensor:
    """Return the inertial unit on the link of an axis; ConfigurationError where the robot file states none."""
    name = robot.axis_names[axis]
    told = robot.description.axes[name].sensors.inertial
    if told is None:
        raise ConfigurationError(
            f"arm_side: the robot file does not say where the inertial unit on the link of {name} is mounted; give "
            f"axis {name} sensors: {{inertial: {{translation: [x, y, z], rotation: ...}}}}, in the joint's frame, m"
        )
    body = robot.chain.names[int(robot.mechanism.arm[axis])]
    return InertialSensor(body, np.array(told.translation), np.array(told.rotation))


def inertial_noise(robot: Robot, axis: int) -> dict[str, float]:
    """Standard deviation of what the unit on the link of an axis shows, m/s^2 and rad/s; zeros where it has none."""
    told = robot.description.axes[robot.axis_names[axis]].sensors.inertial
    return {
        ACCELERATION: 0.0 if told is None else told.acceleration_noise,
        TURN_RATE: 0.0 if told is None else told.turn_rate_noise,
    }


def shown_by_inertial(robot: Robot, axis: int, coordinates: FloatArray, periodic: bool) -> FloatArray:
    """Six components of an inertial unit, accelerations first, for coordinates (n_time, ..., n_coordinate).

    Where the coordinates are one period their lines are differentiated exactly, else as by `derivative`.
    """
    step = robot.sample_time_s
    joint = coordinates @ robot.mechanism.constraint_map.T

    def rate(values: FloatArray) -> FloatArray:
        return derivative(values, step, RATE_BAND / step, periodic)

    return np.concatenate(inertial_of(robot, axis).shown(robot.chain, joint, rate), axis=-1)
