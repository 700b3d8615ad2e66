"""A model as a robot file: it names its base, loads equal, says what it knows, and notices another base."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_core.robot.file.derived_file import derived_yaml

FOUND = {"gear_stiffness.axis_1": 61234.5678901234, "friction.axis_1.coulomb": 0.1 + 0.2}
OWN = "robid_robot: 1\nname: mine\nbase: one_axis\neffects:\n  grease: {use: friction.stribeck, on: axis_1}\n"


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    (tmp_path / "robot.yaml").write_text(OWN)
    return Robot.load("robot.yaml", tmp_path)


def test_the_file_names_its_base_loads_equal_and_says_what_it_knows(robot: Robot, tmp_path: Path) -> None:
    values = {**FOUND, "mass.axis_1": 40.0, "effect.grease.breakaway": 1e-7}
    model = robot.model(
        values, tuple(FOUND), np.diag([120.0**2, np.nan]), left_out=("first_moment.axis_1.x",)
    )
    folder = tmp_path / "runs" / "mine"
    folder.mkdir(parents=True)
    text = derived_yaml(model, "../../robot.yaml", "What stage 'fit' found.\nWritten by robid run.")
    (folder / "robot.fit.yaml").write_text(text)
    loaded = Robot.load("robot.fit.yaml", folder)
    assert loaded == robot.with_parameters(values) == Robot.of_model(model)
    lines = re.sub(" +", " ", text).splitlines()
    assert lines[:3] == [
        "# What stage 'fit' found.",
        "# Written by robid run.",
        "# Estimated, and no number of a robot file: first_moment.axis_1.x.",
    ]
    assert "base: ../../robot.yaml" in lines
    assert lines[-4:] == [
        " gear_stiffness.axis_1: 61234.5678901234 # N m/rad, standard error 120, before 80000",
        " friction.axis_1.coulomb: 0.30000000000000004 # N m, standard error unknown, before 0.5",
        " mass.axis_1: 40.0 # kg, as before",
        " effect.grease.breakaway: 1e-07 # N m, no standard error, before 0.8",
    ]


def test_another_base_than_the_one_it_was_made_from_is_refused(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "found.yaml").write_text(derived_yaml(robot.model(FOUND), "robot.yaml", "found"))
    (tmp_path / "robot.yaml").write_text(OWN + "parameters: {mass.axis_1: 41}\n")
    with pytest.raises(
        ConfigurationError,
        match=r"^found.yaml:4:1: base_sha256: mine has changed since this file was made from it",
    ):
        Robot.load("found.yaml", tmp_path)
    text = (tmp_path / "found.yaml").read_text()
    (tmp_path / "found.yaml").write_text(re.sub("base_sha256: .*\n", "", text))
    assert Robot.load("found.yaml", tmp_path).parameter("mass.axis_1") == 41


def test_a_robot_that_a_run_has_not_written_is_told_as_that(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(
        ConfigurationError, match="the run in this folder has written no such robot: .*robid show"
    ):
        Robot.load("robot.fit.yaml", tmp_path)


def test_factors_multiply_those_of_the_base_and_parameters_come_after(robot: Robot, tmp_path: Path) -> None:
    text = (
        "robid_robot: 1\nbase: robot.yaml\nfactors: {'gear_*': 0.5, '*stiffness.axis_1': 0.25, 'friction.*': 2}\n"
        "parameters: {friction.axis_1.coulomb: 0.7}\n"
    )
    (tmp_path / "softer.yaml").write_text(text)
    softer = Robot.load("softer.yaml", tmp_path)
    factors = {"gear_stiffness.axis_1": 0.125, "gear_damping.axis_1": 0.5, "friction.axis_1.viscous": 2.0}
    factors |= {"friction.axis_1.speed": 2.0, "gear_ratio.axis_1": 0.5}
    expected = {name: factor * robot.parameter(name) for name, factor in factors.items()}
    assert softer == robot.with_parameters(expected | {"friction.axis_1.coulomb": 0.7})


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        ("{gear_stifness.*: 0.5}", "3:11: factors.gear_stifness.*: mine has no such parameter; did you mean"),
        ("{gear_stiffness.*: -1}", "3:1: factors.gear_stiffness.axis_1: -80000.0 must be greater than 0"),
        (
            "{gear_stiffness.*: soft}",
            "3:11: factors.gear_stiffness.*: 'soft' is written here, it must be a number",
        ),
    ],
)
def test_factors_that_mean_nothing_are_refused(robot: Robot, tmp_path: Path, factors: str, told: str) -> None:
    (tmp_path / "softer.yaml").write_text(f"robid_robot: 1\nbase: robot.yaml\nfactors: {factors}\n")
    with pytest.raises(ConfigurationError) as refused:
        Robot.load("softer.yaml", tmp_path)
    assert told in str(refused.value)


def test_effects_that_are_added_or_taken_off_load_equal(robot: Robot, tmp_path: Path) -> None:
    whole = robot.description.model_dump()
    whole["effects"] = {"ripple": {"use": "drive.torque_ripple", "on": "axis_1", "with": {"amplitude": 0.2}}}
    changed = dataclasses.replace(robot, description=type(robot.description).model_validate(whole))
    (tmp_path / "found.yaml").write_text(derived_yaml(changed.model({}), "robot.yaml", "found"))
    assert Robot.load("found.yaml", tmp_path) == changed


def test_an_effect_that_the_base_lacks_cannot_be_taken_off(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(OWN.replace("{use: friction.stribeck, on: axis_1}", "null"))
    with pytest.raises(
        ConfigurationError,
        match=r"robot.yaml:5:3: effects.grease: one_axis has no effect of this label to take off; it has: none",
    ):
        Robot.load("robot.yaml", tmp_path)


def test_names_that_yaml_would_take_for_something_else_are_quoted(tmp_path: Path) -> None:
    axes = "axes:\n  'yes: no':\n    rotor_inertia: 1.0\n    torque_limit: 1.0\n    speed_limit: 1.0\n"
    head = "robid_robot: 1\nname: odd\nbodies:\n  - {joint: 'yes: no', mass: 2.0}\n"
    (tmp_path / "true").write_text(
        head + axes + "    position_limits: [-1.0, 1.0]\n    controller: {speed_gain: 1.0}\n"
    )
    robot = Robot.load("true", tmp_path)
    model = robot.model({"mass.yes: no": 2.5})
    (tmp_path / "found.yaml").write_text(derived_yaml(model, "true", "found"))
    assert Robot.load("found.yaml", tmp_path).parameter("mass.yes: no") == 2.5


PLATE = """\
robid_robot: 1
name: plate
bodies: [{joint: j, mass: 2.0, inertia: [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.2]]}]
axes:
  j: {rotor_inertia: 1.0e-3, torque_limit: 1.0, speed_limit: 1.0, position_limits: [-1, 1],
      controller: {speed_gain: 1.0}}
"""


def test_moments_that_are_right_together_load_though_each_alone_would_be_wrong(tmp_path: Path) -> None:
    """A plate: its largest moment is the sum of the others, and none can change alone."""
    (tmp_path / "robot.yaml").write_text(PLATE)
    robot = Robot.load("robot.yaml", tmp_path)
    values = {"inertia.j.xx": 0.101, "inertia.j.yy": 0.102, "inertia.j.zz": 0.203}
    (tmp_path / "found.yaml").write_text(derived_yaml(robot.model(values), "robot.yaml", "found"))
    assert Robot.load("found.yaml", tmp_path) == robot.with_parameters(values)
    derived = "robid_robot: 1\nbase: robot.yaml\nparameters: {inertia.j.xx: %g, inertia.j.zz: %g}\n"
    (tmp_path / "wrong.yaml").write_text(derived % (0.101, 0.3))
    with pytest.raises(
        ConfigurationError, match=r"^wrong.yaml:3:35: parameters.inertia.j.zz: principal moments 0.1, 0.1"
    ):
        Robot.load("wrong.yaml", tmp_path)
    (tmp_path / "wrong.yaml").write_text(derived % (0.29, 0.15))
    with pytest.raises(
        ConfigurationError, match=r"^wrong.yaml:3:1: parameters: principal moments 0.1, 0.15, 0.29"
    ):
        Robot.load("wrong.yaml", tmp_path)
