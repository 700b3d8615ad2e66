"""Springs about lines that meet in one point: seen in the description, and a combination that no motor feels."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.robots import changed

from robid_core import Robot
from robid_core.robot.file.meeting import meeting_springs

NAMES = (
    "gear_stiffness.axis_1",
    "bearing_stiffness.axis_1_x",
    "bearing_stiffness.axis_2_x",
    "bearing_stiffness.axis_2_z",
)


def shoulder(offset: float) -> Robot:
    """The packaged arm with its second joint so far from the first, and no bearing on the line of the second.

    Springs have dampers in one ratio, so that their complex compliances have one phase.
    """
    robot = Robot.load("six_axis")
    bodies = [body.model_dump(mode="json") for body in robot.description.bodies]
    bodies[1]["translation"] = (offset, 0.0, 0.0)
    bodies[0]["mass"], bodies[0]["centre_of_mass"] = 1.0, (0.0, 0.0, 0.0)
    bodies[0]["inertia"] = (1e-3 * np.eye(3)).tolist()
    bearings = {name: entry.model_dump() for name, entry in robot.description.bearings.items()}
    del bearings["axis_1_y"]
    robot = changed(robot, bodies=bodies, bearings=bearings)
    dampers = {name.replace("stiffness", "damping"): 1e-4 * robot.parameter(name) for name in NAMES}
    return robot.with_parameters(dampers)


def unfelt_share(robot: Robot) -> float:
    """How much less motors feel of the combination than of the single compliance that they feel least."""
    generator, frequency = np.random.default_rng(0), np.linspace(4, 60, 15)
    angle = generator.uniform(-1.5, 1.5, (4, robot.n_axis))
    columns = []
    for name in NAMES:
        value, size = robot.parameter(name), 1e-4
        ends = [
            robot.with_parameters({name: value * (1 + sign * size)}).response(angle, frequency)
            for sign in (1, -1)
        ]
        slope = -value * (ends[0] - ends[1]) / np.abs(robot.response(angle, frequency))
        columns.append(np.concatenate([slope.real.ravel(), slope.imag.ravel()]))
    combination = np.array([1.0, 1.0, -1.0, -1.0]) @ columns
    return float(np.linalg.norm(combination) / np.linalg.norm(columns, axis=1).min())


def test_tilts_and_the_gear_about_one_point_are_one_too_many() -> None:
    """A tilt in both directions behind is, in sum, a tilt before and a twist of the first gear: at no angle another.

    Motors feel the combination by the inertia between, and as gravity bends the springs, alone: by half a percent of
    what they feel of a single one, where it is a fifth with the joints 50 mm apart, and more than that single one with
    300 mm.
    """
    (group,) = meeting_springs(shoulder(0.0).description)
    assert (group.names, group.joint, group.least) == (NAMES, "axis_2", "bearing_stiffness.axis_2_x")
    assert "not identifiable by structure" in group.sentence
    together, apart, far = (unfelt_share(shoulder(offset)) for offset in (0.0, 0.05, 0.3))
    assert together < 0.005
    assert apart > 20 * together
    assert far > 1


@pytest.mark.parametrize("name", [*NAMES[1:], "gear"])
def test_without_any_of_them_the_others_are_told_apart(name: str) -> None:
    robot = shoulder(0.0)
    bearings = {
        label: entry.model_dump()
        for label, entry in robot.description.bearings.items()
        if f"bearing_stiffness.{label}" != name
    }
    axes = {label: axis.model_dump(mode="json") for label, axis in robot.description.axes.items()}
    if name == "gear":
        axes["axis_1"]["gear"] = None
    assert not list(meeting_springs(changed(robot, bearings=bearings, axes=axes).description))


def test_joints_that_are_apart_have_no_such_springs() -> None:
    assert not list(meeting_springs(shoulder(1e-4).description))
    assert not list(meeting_springs(Robot.load("six_axis").description))
