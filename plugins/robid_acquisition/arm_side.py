"""What sensors behind the gears of a simulated plant show: encoders, torque sensors, inertial units on links.

An encoder shows the joint's angle, a torque sensor what spring and damper of the gear pass on, ``k e + d e'`` with the
deflection e, an inertial unit acceleration and rate of turn of its link. All are sampled when the motors' encoders are;
their noise is white.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from robid_core import FloatArray, Robot
from robid_core.mechanics.feedforward import derivative
from robid_core.residual.inertial_units import INERTIAL, channels_of, inertial_noise, shown_by_inertial

ArmSide = Literal["joint_position", "joint_torque", "link_acceleration", "link_turn_rate"]

RATE_BAND = (
    0.25  # of the sampling rate: at a third of it a rate errs by 2e-3, of what a damper adds to a spring
)
UNITS: dict[ArmSide, str] = {
    "joint_position": "rad",
    "joint_torque": "N m",
    "link_acceleration": "m/s^2",
    "link_turn_rate": "rad/s",
}


def why_not(robot: Robot, channels: Sequence[ArmSide]) -> str:
    """Say why a plant cannot show these channels; empty where it can."""
    without = not any(axis.sensors.inertial for axis in robot.description.axes.values())
    for channel in INERTIAL:
        if channel in channels and without:
            return (
                f"{channel}: no axis of {robot.name} has an inertial unit on its link; give one sensors: {{inertial: "
                "{translation: [x, y, z]}}, or leave it out"
            )
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


def shown(robot: Robot, channel: ArmSide, coordinates: FloatArray, seed: int) -> dict[str, FloatArray]:
    """What the sensors of one kind measure in an experiment, by channel, (n_sample, n_axis); NaN where there is none.

    Parameters
    ----------
    robot
        The plant; its file states the noise (`sensors: {joint_position_noise, joint_torque_noise, inertial}`).
    coordinates
        Generalised coordinates of one experiment, (n_sample, n_coordinate).
    seed
        Of the experiment.
    """
    mechanism, drives = robot.mechanism, robot.drives
    generator = np.random.default_rng([seed, list(UNITS).index(channel)])
    names = channels_of([channel])
    noise = generator.standard_normal((len(names), len(coordinates), robot.n_axis))
    if channel == "joint_position":
        joint = coordinates @ mechanism.constraint_map[mechanism.arm].T
        return {channel: joint + noise[0] * drives.joint_position_noise}
    if channel in INERTIAL:
        found = np.full(noise.shape, np.nan)
        for axis, told in enumerate(robot.description.axes.values()):
            if told.sensors.inertial is not None:
                first = 3 * INERTIAL.index(channel)
                six = shown_by_inertial(robot, axis, coordinates, periodic=False)
                size = inertial_noise(robot, axis)[channel]
                found[..., axis] = six[:, first : first + 3].T + noise[..., axis] * size
        return dict(zip(names, found, strict=True))
    elastic, (stiffness, damping) = mechanism.elastic_gear, robot.spring_arrays()
    gears = slice(0, int(elastic.sum()))
    bent = coordinates @ mechanism.spring_directions[gears].T
    rate = derivative(bent, robot.sample_time_s, RATE_BAND / robot.sample_time_s)
    torque = np.full((len(coordinates), robot.n_axis), np.nan)
    torque[:, elastic] = stiffness[gears] * bent + damping[gears] * rate
    return {channel: torque + noise[0] * drives.joint_torque_noise}
