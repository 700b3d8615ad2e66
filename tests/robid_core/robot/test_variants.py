"""A robot with one thing more or less is the robot that its file would describe."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot

ANGLE = np.array([[0.3, 0.5, -0.2, 0.4, 0.6, 0.1]])
EFFECTS = {
    "grease": "{use: friction.stribeck, on: axis_2}",
    "hard": "{use: transmission.stiffening, on: axis_1_y, side: bearing, with: {cubic: 1.0e+10}}",
    "tool": "{use: load.payload, on: axis_6, with: {mass: 4}}",
    "late": "{use: sensing.delay, on: axis_5}",
}


def robot_of(folder: Path, *labels: str) -> Robot:
    lines = [f"  {label}: {EFFECTS[label]}" for label in labels]
    text = "\n".join(
        ["robid_robot: 1", "name: tried", "base: six_axis", *(["effects:", *lines] if lines else [])]
    )
    path = folder / "robot.yaml"
    path.write_text(text + "\n")
    return Robot.load(str(path))


def computed(robot: Robot) -> list[np.ndarray]:
    """What a robot with these bodies, drives, springs and laws does."""
    response = robot.response(ANGLE, np.array([5.0, 20.0]))
    run = robot.simulate(5.0 * np.ones((1, 60, 6)), ANGLE)
    return [response, run.torque, robot.gravity_torque(ANGLE), *robot.spring_arrays()]


def assert_same(ours: Robot, theirs: Robot) -> None:
    assert ours.description == theirs.description
    assert ours.parameters() == theirs.parameters()
    for a, b in zip(computed(ours), computed(theirs), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("label", EFFECTS)
def test_an_effect_more_is_that_of_a_file_and_one_less_gives_the_robot_back(
    tmp_path: Path, label: str
) -> None:
    given = tuple(other for other in EFFECTS if other != label)
    robot = robot_of(tmp_path, *given)
    computed(robot)  # what another may keep is there
    entry = robot_of(tmp_path, label).description.effects[label]
    more = robot.with_effect(label, entry.use, entry.on, entry.side, entry.with_)
    assert_same(more, robot_of(tmp_path, *given, label))
    assert_same(more.without_effect(label), robot)


def test_laws_and_signals_leave_bodies_and_drives_as_they_are(tmp_path: Path) -> None:
    robot = robot_of(tmp_path)
    computed(robot)
    more = robot.with_effect("grease", "friction.stribeck", on="axis_2")
    heavier = robot.with_effect("tool", "load.payload", on="axis_6")
    for what in ("chain", "mechanism", "drives"):
        assert getattr(more, what) is getattr(robot, what)
        assert getattr(more.without_effect("grease"), what) is getattr(robot, what)
        assert getattr(heavier, what) is not getattr(robot, what)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (("grease", "friction.stribeck", "axis_2"), r"has an effect 'grease' \(friction.stribeck\) already"),
        (("soft", "friction.stribek", "axis_2"), "did you mean 'friction.stribeck'"),
        (("soft", "friction.stribeck", "axis_9"), "no axis 'axis_9'"),
        (("soft", "friction.stribeck", "axis_2", "tooth"), "no side 'tooth'"),
        (("soft", "friction.stribeck", "axis_2", None, {"breakway": 1.0}), "did you mean 'breakaway'"),
        (("soft", "friction.stribeck", "axis_2", None, {"breakaway": np.nan}), "effects.soft.with.breakaway"),
        (("not so", "friction.stribeck", "axis_2"), "effects.not so"),
        (("tool", "load.payload", "nowhere"), "nowhere"),
    ],
)
def test_an_effect_that_cannot_be_is_told_at_once(tmp_path: Path, call: tuple[Any, ...], told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        robot_of(tmp_path, "grease").with_effect(*call)


def test_an_effect_that_is_not_there_cannot_go(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no effect 'greese'; did you mean 'grease'"):
        robot_of(tmp_path, "grease").without_effect("greese")


def test_without_friction_nothing_dry_is_left(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, "grease", "hard", "late").with_parameters({"friction.axis_3.offset": 0.2})
    bare = robot.without_friction()
    assert list(bare.description.effects) == ["hard", "late"]
    assert not bare.drives.coulomb.any()
    assert not bare.drives.friction_offset.any()
    np.testing.assert_array_equal(bare.drives.viscous, robot.drives.viscous)
    damping = np.linspace(1e-3, 6e-3, 6)
    np.testing.assert_array_equal(robot.without_friction(damping).drives.viscous, damping)
    changed = {f.name for f in fields(bare.drives) if f.name != "description" and not np.array_equal(
        getattr(bare.drives, f.name), getattr(robot.drives, f.name))}  # fmt: skip
    assert changed == {"coulomb", "friction_offset"}
