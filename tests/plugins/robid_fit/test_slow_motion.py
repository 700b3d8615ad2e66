"""The factor of slow motion against a brute mean over the motion."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from robid_core import Frf, Robot
from robid_core.estimation.response.controller import controller_response, feedback_from_acceleration
from robid_fit.slow_motion import slow_motion_gain

FREQUENCY = np.array([5.0, 9.0, 17.0, 33.0, 61.0])


def told(angle: np.ndarray, covariance: np.ndarray | None) -> Frf:
    frf = SimpleNamespace(
        angle=angle, frequency_hz=FREQUENCY, torque_hold="zero_order_hold", travel_covariance=covariance
    )
    return cast("Frf", frf)


def test_a_robot_that_stands_has_no_factor() -> None:
    robot, angle = Robot.load("six_axis"), np.full((2, 6), 0.3)
    damping = np.broadcast_to(robot.drives.viscous, (2, 6)).copy()
    for covariance in (None, np.zeros((2, 6, 6))):
        np.testing.assert_allclose(slow_motion_gain(robot, told(angle, covariance), damping), 1, rtol=1e-10)


def test_the_factor_is_that_of_a_mean_over_the_motion_in_closed_loop() -> None:
    """All axes on one sine, in and out of phase: 60 poses along it, the loop closed in each, opened in the mean.

    The rule is exact to fourth order along the one axis of such a motion: left is the sixth, a thousandth of the
    change here.
    """
    robot = Robot.load("six_axis")
    angle, n = np.array([[0.4, -0.3, 0.5, 0.2, 0.7, 0.0]]), 60
    amplitude = 4.0 * np.array([1.0, -1.0, 0.5, 1.0, -0.5, 1.0])
    covariance = 0.5 * np.outer(amplitude, amplitude)[None]
    damping = np.full((1, 6), 0.02)
    poses = angle + robot.joint_angle(np.cos(2 * np.pi * (np.arange(n) + 0.5) / n)[:, None] * amplitude)
    loop = controller_response(robot.drives, robot.sample_time_s, FREQUENCY)
    feedback = feedback_from_acceleration(loop, FREQUENCY)[:, :, None] * np.eye(6)
    each = robot.response(poses, FREQUENCY, np.repeat(damping, n, axis=0))
    closed = np.linalg.inv(np.linalg.inv(each) + feedback).mean(axis=0)
    opened = np.linalg.inv(np.linalg.inv(closed) - feedback)
    plain = robot.response(angle, FREQUENCY, damping)[0]
    made = slow_motion_gain(robot, told(angle, covariance), damping)[0] * plain
    change = np.abs(opened - plain).max(axis=(1, 2))
    assert (change > 1e-3 * np.abs(plain).max(axis=(1, 2))).any()
    np.testing.assert_array_less(np.abs(made - opened).max(axis=(1, 2)), 0.01 * change)
