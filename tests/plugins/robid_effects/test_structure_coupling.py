"""Coupled axes: kinematics and, by virtual work, torques follow one matrix."""

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_effects.structure_coupling import CoupledAxes

RATIO, MOTOR = -0.004, 5
ANGLE = np.array([[0.3, -0.4, 0.5, 0.2, 0.7, -0.3], [0.0, 0.5, -0.6, 1.0, -0.8, 0.4]])


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("six_axis")


@pytest.fixture(scope="module")
def coupled(robot: Robot) -> Robot:
    return CoupledAxes.apply(robot, np.array([RATIO, float(MOTOR)]), "axis_6", "wrist")


def test_one_entry_of_the_gear_matrix_changes(robot: Robot, coupled: Robot) -> None:
    change = coupled.drives.gear - robot.drives.gear
    expected = np.zeros((6, 6))
    expected[5, MOTOR - 1] = RATIO
    np.testing.assert_allclose(change, expected, atol=1e-18)
    np.testing.assert_array_equal(coupled.mechanism.gear, coupled.drives.gear)


def test_the_axis_turns_with_the_other_motor(robot: Robot, coupled: Robot) -> None:
    motor = np.zeros(6)
    motor[MOTOR - 1] = 10.0
    moved = coupled.joint_angle(motor) - robot.joint_angle(motor)
    np.testing.assert_allclose(moved, [0, 0, 0, 0, 0, 10 * RATIO], atol=1e-15)


def test_the_other_motor_carries_part_of_the_axis_torque(robot: Robot, coupled: Robot) -> None:
    """At the same joint angles the joints' torques are the same; motors hold the transpose of the matrix times them."""
    joint = np.linalg.solve(robot.drives.gear.T, robot.gravity_torque(ANGLE).T)
    expected = (coupled.drives.gear.T @ joint).T
    assert np.abs(expected - robot.gravity_torque(ANGLE)).max() > 1e-3  # there is something to carry
    np.testing.assert_allclose(coupled.gravity_torque(ANGLE), expected, rtol=1e-8, atol=1e-10)


def test_two_of_them_add_up(robot: Robot, coupled: Robot) -> None:
    twice = CoupledAxes.apply(coupled, np.array([0.002, 4.0]), "axis_6", "wrist_2")
    np.testing.assert_allclose(twice.drives.gear[5, 3:5], [0.002, RATIO], atol=1e-18)
    again = CoupledAxes.apply(coupled, np.array([-RATIO, float(MOTOR)]), "axis_6", "back")
    np.testing.assert_allclose(again.drives.gear, robot.drives.gear, atol=1e-18)


def test_the_given_robot_stays_as_it_was(robot: Robot, coupled: Robot) -> None:
    assert robot.description.coupling is None
    assert coupled.description.coupling is not None
    np.testing.assert_array_equal(robot.drives.gear, Robot.load("six_axis").drives.gear)


@pytest.mark.parametrize(
    ("on", "motor", "told"),
    [
        ("axis_7", 1.0, "there is no axis 'axis_7'"),
        (None, 1.0, "there is no axis 'None'"),
        ("axis_6", 7.0, "from_motor is 7; give a whole number from 1 to 6"),
        ("axis_6", 2.5, "from_motor is 2.5"),
        ("axis_6", 6.0, "motor 6 drives axis_6 itself"),
    ],
)
def test_what_cannot_be_coupled_is_refused(robot: Robot, on: str | None, motor: float, told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        CoupledAxes.apply(robot, np.array([0.01, motor]), on, "wrist")
