"""What sensors behind the gears of a simulated plant show: encoders at the links, torque sensors in the joints.

An encoder shows the joint's angle, a torque sensor what spring and damper of the gear pass on, ``k e + d e'`` with the
deflection e. Both are sampled when the motors' encoders are; their noise is white.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from robid_core import FloatArray, Robot
from robid_core.mechanics.feedforward import derivative

ArmSide = Literal["joint_position", "joint_torque"]

RATE_BAND = (
    0.25  # of the sampling rate: at a third of it a rate errs by 2e-3, of what a damper adds to a spring
)
UNITS: dict[ArmSide, str] = {"joint_position": "rad", "joint_torque": "N m"}


def why_not(robot: Robot, channels: Sequence[ArmSide]) -> str:
    """Say why a plant cannot show these channels; empty where it can."""
    if "joint_torque" not in channels:
        return ""
    if robot.bending_forces:
        return (
            f"joint_torque is that of springs and dampers of gears, and effects act beside them in {robot.name}; "
            "leave joint_torque out"
        )
    if not robot.mechanism.elastic_gear.any():
        return f"joint_torque: no gear of {robot.name} has a spring; leave joint_torque out"
    return ""


def shown(robot: Robot, channel: ArmSide, coordinates: FloatArray, seed: int) -> FloatArray:
    """What the sensors of one channel measure in an experiment, (n_sample, n_axis); NaN where an axis has none.

    Parameters
    ----------
    robot
        The plant; its file states the noise (`sensors: {joint_position_noise, joint_torque_noise}`).
    coordinates
        Generalised coordinates of one experiment, (n_sample, n_coordinate).
    seed
        Of the experiment.
    """
    mechanism, drives = robot.mechanism, robot.drives
    generator = np.random.default_rng([seed, list(UNITS).index(channel)])
    noise = generator.standard_normal((len(coordinates), robot.n_axis))
    if channel == "joint_position":
        joint = coordinates @ mechanism.constraint_map[mechanism.arm].T
        return joint + noise * drives.joint_position_noise
    elastic, (stiffness, damping) = mechanism.elastic_gear, robot.spring_arrays()
    gears = slice(0, int(elastic.sum()))
    bent = coordinates @ mechanism.spring_directions[gears].T
    rate = derivative(bent, robot.sample_time_s, RATE_BAND / robot.sample_time_s)
    torque = np.full((len(coordinates), robot.n_axis), np.nan)
    torque[:, elastic] = stiffness[gears] * bent + damping[gears] * rate
    return torque + noise * drives.joint_torque_noise
