"""A robot with other numbers keeps what does not change: it is the robot that its description alone would make."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot

ANGLE = np.array([[0.3, 0.5, -0.2, 0.4, 0.6, 0.1], [-0.5, 0.1, 0.3, -0.7, -0.4, 1.0]])
LINES = np.array([5.0, 20.0, 60.0])
EFFECTS = """\
effects:
  grease: {use: friction.stribeck, on: axis_2}
  load: {use: friction.load_dependent, on: axis_3, side: gear}
  hard: {use: transmission.stiffening, on: axis_2}
  soft: {use: transmission.stiffening, on: axis_1_y, side: bearing}
  lag: {use: drive.current_loop, on: axis_4}
  wave: {use: drive.torque_ripple, on: axis_1}
  late: {use: sensing.delay, on: axis_5}
"""
STRUCTURE = (
    "effects:\n  load: {use: load.payload, on: axis_6}\n  hard: {use: transmission.stiffening, on: axis_2}\n"
)


def robot_of(folder: Path, effects: str) -> Robot:
    path = folder / "robot.yaml"
    path.write_text(f"robid_robot: 1\nname: tried\nbase: six_axis\n{effects}")
    return Robot.load(str(path))


def numbers_of(thing: Any) -> list[np.ndarray]:
    """Every number in arrays, terms and places, in their order."""
    if isinstance(thing, np.ndarray | float | int):
        return [np.asarray(thing)]
    if isinstance(thing, dict):
        return [n for value in thing.values() for n in numbers_of(value)]
    if isinstance(thing, tuple | list):
        return [n for value in thing for n in numbers_of(value)]
    if hasattr(thing, "__dataclass_fields__"):
        return [n for field in fields(thing) for n in numbers_of(getattr(thing, field.name))]
    return []


def assert_same(kept: Robot, fresh: Robot) -> None:
    for what in ("chain", "mechanism", "drives", "effects", "forces", "bending_forces", "signals"):
        ours, theirs = numbers_of(getattr(kept, what)), numbers_of(getattr(fresh, what))
        assert len(ours) == len(theirs), what
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a, b, err_msg=what)
    np.testing.assert_array_equal(kept.spring_arrays(), fresh.spring_arrays())
    assert kept.parameters() == fresh.parameters()
    assert kept.spring_names == fresh.spring_names


def warm(robot: Robot) -> Robot:
    """Let a robot compute everything that another may keep."""
    robot.response(ANGLE, LINES)
    _ = robot.signals, robot.forces, robot.drives
    return robot


@pytest.mark.parametrize(
    "effects",
    [pytest.param("", marks=pytest.mark.full), EFFECTS, STRUCTURE],
    ids=["none", "laws", "structure"],
)
def test_after_a_change_of_any_number_nothing_is_left_of_the_old_one(tmp_path: Path, effects: str) -> None:
    robot = warm(robot_of(tmp_path, effects))
    for name, value in robot.parameters().items():
        if name.startswith(("sensors.", "controller.")) and not name.endswith("axis_2.speed_gain"):
            continue  # one for all of them
        try:
            kept = robot.with_parameters({name: 0.99 * value + 1e-6})
        except ConfigurationError:  # a moment that no body has
            assert name.startswith("inertia.")
            continue
        assert_same(kept, Robot(kept.description))


def test_changes_of_many_numbers_one_after_another_leave_nothing_old(tmp_path: Path) -> None:
    generator = np.random.default_rng(3)
    robot = warm(robot_of(tmp_path, EFFECTS))
    names = [n for n in robot.parameters() if not n.startswith(("inertia.", "controller."))]
    for _ in range(25):
        chosen = generator.choice(names, size=int(generator.integers(1, 6)), replace=False)
        values = {str(n): 0.99 * robot.parameter(str(n)) + 1e-6 for n in chosen}
        robot = robot.with_parameters(values)
        fresh = Robot(robot.description)
        assert_same(robot, fresh)
        np.testing.assert_array_equal(robot.response(ANGLE, LINES), fresh.response(ANGLE, LINES))


def test_a_spring_leaves_everything_that_does_not_know_it(tmp_path: Path) -> None:
    robot = warm(robot_of(tmp_path, EFFECTS))
    changed = robot.with_parameters({"gear_stiffness.axis_4": 1e5})
    for kept in ("chain", "mechanism", "drives", "layout", "forces"):
        assert getattr(changed, kept) is getattr(robot, kept)
    stiffer = robot.with_parameters({"gear_stiffness.axis_2": 1e6})
    (bound,) = [effect for effect in stiffer.effects if effect.label == "hard"]
    assert bound.place.stiffness == 1e6


def test_a_name_that_is_not_there_is_told_with_what_comes_near() -> None:
    with pytest.raises(
        ConfigurationError, match=r"no parameter gear_stifness.axis_1; did you mean 'gear_stiffness"
    ):
        Robot.load("six_axis").with_parameters({"gear_stifness.axis_1": 1.0})
