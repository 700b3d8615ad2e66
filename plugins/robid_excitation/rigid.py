"""What a motion about a configuration may use of a robot's limits, the nominal robot taken as a rigid one.

The simulation that clears an excitation has its bearings, gears, links and effects.
"""

from __future__ import annotations

import numpy as np

from robid_core import ConfigurationError, FloatArray, MotionRefused, Robot
from robid_core.estimation.excitation.fourier_trajectory import Limits
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque


def motion_limits(robot: Robot, angle: FloatArray, reach: FloatArray, margin: float) -> Limits:
    """Limits of a motion about a configuration.

    Parameters
    ----------
    robot
        The nominal robot.
    angle
        The configuration, joint side, (n_axis,).
    reach
        How far each joint may go from it, rad (m), (n_axis,); infinite: up to its limits.
    margin
        Share of the limits of torque, speed and acceleration that may be used.
    """
    limits, d = robot.limits, robot.drives
    return Limits(
        lower=limits.lower,
        upper=limits.upper,
        joint_lower=np.maximum(d.lower, angle - reach),
        joint_upper=np.minimum(d.upper, angle + reach),
        speed=margin * limits.speed,
        acceleration=margin * limits.acceleration,
        torque=margin * d.torque_limit,
    )


def refuse_without_room(
    robot: Robot, drives: RigidDrives, limits: Limits, angle: FloatArray, place: str
) -> None:
    """Raise MotionRefused where a configuration leaves nothing to move with.

    That is, where a joint stands at its limit, or where gravity and dry friction take all of a motor's torque.
    """
    room = np.minimum(angle - limits.joint_lower, limits.joint_upper - angle)
    motor = robot.motor_angle(angle)[None]
    still = np.zeros_like(motor)
    held = np.abs(motor_torque(drives, motor, still, still)[0])
    for axis, name in enumerate(robot.axis_names):
        if not room[axis] > 0:
            raise MotionRefused(
                f"{place}: {name} stands at {angle[axis]:.4g} rad and may go from {limits.joint_lower[axis]:.4g} to "
                f"{limits.joint_upper[axis]:.4g} rad; move the configuration away from the limit"
            )
        if held[axis] + drives.coulomb[axis] >= limits.torque[axis]:
            raise MotionRefused(
                f"{place}: {name} needs {held[axis]:.4g} N m at its motor to stand still and "
                f"{drives.coulomb[axis]:.4g} N m to break away, {limits.torque[axis]:.4g} N m are allowed; "
                "take another configuration"
            )


def torque_noise(robot: Robot) -> FloatArray:
    """Noise of each motor's torque, N m, (n_axis,); its torque limit, for comparison, where a sensor states none."""
    noise, limit = robot.drives.torque_noise, robot.drives.torque_limit
    return noise if (noise > 0).all() else limit


def whole_samples(seconds: float, robot: Robot, setting: str) -> int:
    """Samples in a time; ConfigurationError unless they are whole."""
    n_sample = seconds / robot.sample_time_s
    if abs(n_sample - round(n_sample)) > 1e-6:
        near = round(n_sample) * robot.sample_time_s
        raise ConfigurationError(
            f"{setting}: {seconds:g} s is not a whole number of the robot's samples of {robot.sample_time_s:g} s; "
            f"{near:.9g} s is"
        )
    return round(n_sample)
