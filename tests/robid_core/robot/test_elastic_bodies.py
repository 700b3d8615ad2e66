"""Joints that no drive moves, held by a spring of their own: a three-mass drive, and what contradicts itself."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from robid_core import ConfigurationError, Robot

THREE_MASSES = """
robid_robot: 1
name: three_masses
gravity: [0, 0, 0]
bodies:
  - {joint: drive, axis: [0, 0, 1], mass: 1, inertia: [[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.6]]}
  - joint: shaft
    parent: drive
    axis: [0, 0, 1]
    mass: 1
    inertia: [[0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.3]]
    elastic: {stiffness: 900, damping: 0.4}
  - {joint: slide, parent: shaft, type: prismatic, axis: [0, 0, 1], mass: 2, elastic: {stiffness: 800, damping: 3}}
axes:
  drive:
    gear_ratio: 10
    rotor_inertia: 0.002
    torque_limit: 5
    speed_limit: 300
    gear: {stiffness: 700, damping: 0.5}
    controller: {speed_gain: 0.1}
"""


def robot_of(text: str, folder: Path) -> Robot:
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return Robot.load("robot.yaml", folder)


def test_frequencies_are_those_of_three_inertias_and_a_mass(tmp_path: Path) -> None:
    """Absolute angles of motor / 10, drive and shaft; the slide moves by itself at sqrt(800 / 2)."""
    model = robot_of(THREE_MASSES, tmp_path).second_order(np.zeros((1, 1)))
    inertia = np.diag([0.002 * 100, 0.6, 0.3])
    stiffness = np.array([[700, -700, 0], [-700, 1600, -900], [0, -900, 900.0]])
    expected = np.sort(np.r_[eigh(stiffness, inertia, eigvals_only=True), 400.0])
    found = eigh(model.stiffness[0], model.mass[0], eigvals_only=True)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9 * expected[-1])


def test_springs_have_names_units_and_values_that_can_be_set(tmp_path: Path) -> None:
    robot = robot_of(THREE_MASSES, tmp_path)
    names = ("gear_stiffness.drive", "bearing_stiffness.shaft", "bearing_stiffness.slide")
    assert robot.stiffness_names == names
    assert [robot.parameter_unit(name) for name in names] == ["N m/rad", "N m/rad", "N/m"]
    changed = robot.with_parameters({"bearing_stiffness.shaft": 450.0, "bearing_damping.slide": 7.0})
    np.testing.assert_array_equal(changed.spring_arrays()[0], [700, 450, 800])
    np.testing.assert_array_equal(changed.spring_arrays()[1], [0.5, 0.4, 7])


def test_it_goes_out_to_yaml_and_comes_back_equal(tmp_path: Path) -> None:
    robot = robot_of(THREE_MASSES, tmp_path)
    assert robot_of(robot.to_yaml(), tmp_path).description == robot.description


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "    elastic: {stiffness: 900, damping: 0.4}\n",
            "",
            r"'shaft' has no drive; .* \(elastic: {stiffness, damping}\)",
        ),
        (
            "mass: 1, inertia",
            "mass: 1, elastic: {stiffness: 1, damping: 0}, inertia",
            "'drive' is elastic and axis",
        ),
        ("stiffness: 900", "stiffness: -900", "-900"),
    ],
)
def test_a_joint_has_a_drive_or_a_spring(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in THREE_MASSES
    with pytest.raises(ConfigurationError, match=message):
        robot_of(THREE_MASSES.replace(old, new), tmp_path)
