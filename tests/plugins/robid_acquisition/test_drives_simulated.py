"""Drives simulated in memory, against the plant that they stand for."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from robid_acquisition.simulated import OpenSimulatedDrives, SimulatedDrives, saturation_level
from robid_core import ConfigurationError, Experiment, MotionRefused, Robot, Session, clear_motion


@pytest.fixture(scope="module")
def robot():
    return Robot.load("one_axis_true")


def experiment(robot, scale=5.0, periods=3, traced=2, seed=11, order=1):
    phase = 2 * np.pi * order * np.arange(200)[:, None] / 200
    reference = scale * np.sin(phase) + scale * np.cos(3 * phase)
    start = robot.motor_angle(np.array([0.2]))
    clearance = clear_motion(start, reference, 1e-3, periods, robot.limits)
    return Experiment("test", start, reference, periods, traced, 1e-3, seed, clearance)


def session(robot):
    return Session(robot, logging.getLogger("test"), None, lambda text: None)


def test_trace_is_the_last_periods_of_what_the_plant_does(robot):
    asked = experiment(robot)
    with SimulatedDrives(plant="one_axis_true").open(session(robot)) as drives:
        trace = drives.perform(asked)
        again = drives.perform(asked)
        other = drives.perform(replace(asked, seed=12))
    plant = robot.plant()
    plant.rest(asked.start)
    position, torque = plant.track(np.tile(asked.reference, (3, 1)), 11)
    np.testing.assert_array_equal(trace.position.reshape(-1, 1), position[200:])
    np.testing.assert_array_equal(trace.torque.reshape(-1, 1), torque[200:])
    np.testing.assert_array_equal(again.position, trace.position)  # at rest at the start again
    assert not np.array_equal(other.torque, trace.torque)
    assert (trace.time_s, again.time_s) == pytest.approx((0.2, 0.8))


def test_motor_follows_its_speed_reference(robot):
    with SimulatedDrives(plant="one_axis_true").open(session(robot)) as drives:
        trace = drives.perform(experiment(robot, periods=10, traced=2))
    speed = np.diff(trace.position[0, :, 0]) / 1e-3
    asked = trace.reference[:-1, 0]
    # A PI loop on a motor with an arm behind a soft gear follows 5 and 15 Hz roughly, not exactly.
    assert np.corrcoef(speed, asked)[0, 1] > 0.8


def test_saturation_is_told_as_the_share_of_limited_samples(robot):
    level = saturation_level(robot)
    limit = robot.drives.torque_limit
    assert (0.9 * limit <= level).all()
    assert (level < limit).all()
    wild = experiment(
        robot, scale=150.0, order=10
    )  # 50 Hz: 1.2e-3 kg m^2 * 314 rad/s * 150 rad/s is above 20 N m
    with SimulatedDrives(plant="one_axis_true").open(session(robot)) as drives:
        trace = drives.perform(wild)
        calm = drives.perform(experiment(robot, scale=0.5))
    expected = (np.abs(trace.torque) >= level).mean(axis=(0, 1))
    assert expected[0] > 0.05
    np.testing.assert_array_equal(trace.saturated, expected)
    # Every limited sample is seen: noise of 3 standard deviations is exceeded once in 740 times
    limited = np.abs(trace.torque) >= limit
    assert trace.saturated[0] >= limited.mean()
    assert calm.saturated[0] == 0


def test_D03_commands_that_were_not_cleared_do_not_move_the_plant(robot):
    asked = experiment(robot)
    with pytest.raises(MotionRefused, match="D03"):
        OpenSimulatedDrives(robot).perform(replace(asked, start=asked.start + 1e-9))


def test_nothing_but_a_simulation_moves_and_the_truth_is_told(robot):
    drives = SimulatedDrives(plant="one_axis_true")
    assert not drives.moves_hardware
    assert drives.truth(Robot.load("one_axis")).as_mapping() == robot.parameters()


def test_plant_with_another_number_of_motors_is_refused():
    class Two:
        name, n_axis = "two", 2

    with pytest.raises(ConfigurationError, match="plant 'one_axis_true' has 1 motor, robot 'two' has 2"):
        SimulatedDrives(plant="one_axis_true").open(session(Two()))
