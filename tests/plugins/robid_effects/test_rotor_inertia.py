"""Rotor inertia error: one number of one axis."""

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_effects.rotor_inertia import RotorInertiaError


def test_one_rotor_changes_and_no_other() -> None:
    robot = Robot.load("six_axis")
    heavier = RotorInertiaError.apply(robot, np.array([0.25]), "axis_3", "brake")
    ratio = heavier.drives.rotor_inertia / robot.drives.rotor_inertia
    np.testing.assert_allclose(ratio, [1, 1, 1.25, 1, 1, 1], rtol=1e-15)
    assert heavier.description.bodies == robot.description.bodies


def test_a_robot_of_one_axis_needs_no_name_and_others_do() -> None:
    robot = Robot.load("one_axis")
    lighter = RotorInertiaError.apply(robot, np.array([-0.5]), None, "brake")
    assert lighter.drives.rotor_inertia == 0.5 * robot.drives.rotor_inertia
    for name in (None, "axis_7"):
        with pytest.raises(
            ConfigurationError, match="effects.brake: there is no axis '(None|axis_7)'; there are axis_1,"
        ):
            RotorInertiaError.apply(Robot.load("six_axis"), np.array([0.1]), name, "brake")
