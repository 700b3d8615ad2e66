"""Recorded torques and motions drive the robot: open loop, and closed loop with the recorded reference."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot

POSE = np.array([[0.3, 0.5, -0.4, 0.2, 0.6, -0.1]])


def _reference() -> np.ndarray:
    t = 1e-3 * np.arange(400)
    turns = np.sin(2 * np.pi * np.outer(t, [2.0, 2.5, 3.0, 3.5, 4.0, 5.0])) * 15.0
    return turns[None]


def test_the_torques_of_a_closed_loop_make_the_same_motion_open_loop() -> None:
    robot = Robot.load("six_axis_true")
    closed = robot.simulate(_reference(), POSE, keep_coordinates=True)
    opened = robot.drive(closed.torque, POSE, keep_coordinates=True)
    assert np.ptp(closed.position, axis=1).min() > 0.3
    # the same sums in another order, amplified for 0.4 s by an arm that nothing holds
    np.testing.assert_allclose(opened.coordinates, closed.coordinates, rtol=0, atol=1e-9)


def test_a_motion_that_is_under_way_goes_on_from_its_speed() -> None:
    robot = Robot.load("one_axis")
    speed = np.array([[40.0]])
    run = robot.drive(np.zeros((1, 200, 1)), np.zeros((1, 1)), motor_speed=speed, keep_coordinates=True)
    start = (run.coordinates[0, 1] - run.coordinates[0, 0]) / 1e-3
    # motor and arm set off together: the spring is not bent by the start
    gear = robot.drives.gear[0, 0]
    assert start[0] == pytest.approx(40.0, rel=0.02)
    assert start[1] == pytest.approx(40.0 * gear, rel=0.02)


def test_a_recorded_motion_as_reference_is_followed() -> None:
    robot = Robot.load("six_axis_true")
    speed = _reference()
    recorded = robot.simulate(speed, POSE).position
    axes = {
        name: axis.model_copy(
            update={
                "controller": axis.controller.model_copy(
                    update={"position_gain": 40.0, "speed_gain": 3 * axis.controller.speed_gain}
                )
            }
        )
        for name, axis in robot.description.axes.items()
    }
    stiff = Robot(robot.description.model_copy(update={"axes": axes}))
    followed = stiff.simulate(np.gradient(recorded, 1e-3, axis=1), POSE, position_reference=recorded)
    span = np.ptp(recorded, axis=1)
    ignored = abs(robot.simulate(0 * speed, POSE).position - recorded).max(axis=1)
    error = abs(followed.position - recorded).max(axis=1)
    assert (error < 0.3 * ignored).all()
    assert (error < 0.3 * span).all()
