"""Springs about one line are seen in the description, and motors cannot tell their stiffnesses apart."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.robots import changed

from robid_core import Robot
from robid_core.robot.file.coaxial import coaxial_springs

SPRING = {"stiffness": 9e4, "damping": 30.0}


def correlation(robot: Robot, first: str, second: str) -> float:
    """Of the two columns of the log response's Jacobian, over poses and lines, each with its own scale."""
    generator, frequency = np.random.default_rng(0), np.linspace(4, 60, 15)
    angle = generator.uniform(-1.5, 1.5, (4, robot.n_axis))
    columns = []
    for name in (first, second):
        value, size = robot.parameter(name), 1e-4
        ends = [
            robot.with_parameters({name: value * (1 + sign * size)}).response(angle, frequency)
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / np.abs(robot.response(angle, frequency))
        columns.append(np.concatenate([slope.real.ravel(), slope.imag.ravel()]))
    a, b = columns
    return float(abs(a @ b) / np.linalg.norm(a) / np.linalg.norm(b))


def test_the_shoulder_of_the_universal_arm_hides_a_bearing() -> None:
    """Axis 2 goes through the origin of axis 1: 0.01 kg m^2 stand between, where 9 kg m^2 hang behind both."""
    plain = Robot.load("universal_arm")
    assert not list(coaxial_springs(plain.description))
    bearings = {name: entry.model_dump() for name, entry in plain.description.bearings.items()}
    bearings["tilt"] = {"joint": "axis_1", "axis": (0.0, 0.0, 1.0), **SPRING}
    robot = changed(plain, bearings=bearings)
    (pair,) = coaxial_springs(robot.description)
    assert (pair.first, pair.axis) == ("bearing_stiffness.tilt", "axis_2")
    body = robot.description.bodies[0]
    offset = np.hypot(*body.centre_of_mass[:2])
    assert pair.inertia == pytest.approx(body.inertia[2][2] + body.mass * offset**2, rel=1e-12)
    assert "not identifiable by structure" in pair.sentence
    assert correlation(robot, pair.first, f"gear_stiffness.{pair.axis}") > 0.99
    assert correlation(robot, "bearing_stiffness.axis_1_x", "gear_stiffness.axis_2") < 0.9


def test_a_line_goes_on_through_a_slide() -> None:
    """The quill of a SCARA turns about the line along which it slides: a bearing of axis 2 about it would be at its own
    joint, one of axis 3 is in front of axis 4."""
    scara = Robot.load("scara")
    bearing = {"twist": {"joint": "axis_3", "axis": (0.0, 0.0, 1.0), **SPRING}}
    (pair,) = coaxial_springs(changed(scara, bearings=bearing).description)
    assert (pair.first, pair.axis, pair.inertia) == ("bearing_stiffness.twist", "axis_4", 2e-4)
    bodies = [body.model_dump(mode="json") for body in scara.description.bodies]
    bodies[0]["elastic"], bodies[1]["translation"] = SPRING, (0.0, 0.0, 0.05)
    bodies[1]["axis"], bodies[1]["type"] = (0.0, 0.0, 1.0), "prismatic"
    bodies[2]["axis"], bodies[2]["type"], bodies[2]["translation"] = (
        (0.0, 0.0, -1.0),
        "revolute",
        (0.0, 0.0, 0.3),
    )
    axes = {
        name: axis.model_dump(mode="json")
        for name, axis in scara.description.axes.items()
        if name != "axis_1"
    }
    robot = changed(scara, bodies=bodies, axes=axes, bearings={})
    (pair,) = coaxial_springs(robot.description)
    assert (pair.first, pair.axis) == ("bearing_stiffness.axis_1", "axis_3")
    first, second = scara.description.bodies[:2]
    levers = [
        body.mass * np.hypot(*body.centre_of_mass[:2]) ** 2 + body.inertia[2][2] for body in (first, second)
    ]
    assert pair.inertia == pytest.approx(sum(levers), rel=1e-12)


def test_lines_that_are_apart_or_across_and_rigid_gears_are_no_pair() -> None:
    robot = Robot.load("six_axis")
    assert not list(coaxial_springs(robot.description))
    bodies = [body.model_dump(mode="json") for body in robot.description.bodies]
    bodies[1]["translation"] = (0.0, 0.0, 0.0)
    (pair,) = coaxial_springs(changed(robot, bodies=bodies).description)
    assert (pair.first, pair.axis) == ("bearing_stiffness.axis_1_y", "axis_2")
    assert not list(coaxial_springs(changed(robot, bodies=bodies, every_axis={"gear": None}).description))
    bodies[1]["translation"] = (0.0, 0.0, 1e-4)
    assert not list(coaxial_springs(changed(robot, bodies=bodies).description))
