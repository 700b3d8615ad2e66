"""An unstable controller and a step too long are refused before anything is simulated, with axis and number."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_core.mechanics import SimulationDiverged
from robid_core.robot.plant import continue_simulation, standing
from robid_core.robot.stability import refuse_unstable

POSE = np.array([0.3, 0.5, -0.4, 0.2, 0.6, -0.1])


def _with_gains(robot: Robot, axis: str, **gains: float) -> Robot:
    old = robot.description.axes[axis]
    new = old.model_copy(update={"controller": old.controller.model_copy(update=gains)})
    return replace(
        robot,
        description=robot.description.model_copy(update={"axes": {**robot.description.axes, axis: new}}),
    )


def test_the_packaged_robots_are_stable() -> None:
    for name in ("six_axis", "six_axis_true", "one_axis", "one_axis_true"):
        robot = Robot.load(name)
        pose = POSE if robot.n_axis == 6 else np.zeros(1)
        refuse_unstable(robot, pose, robot.step_s, "implicit_midpoint")


def test_an_unstable_controller_is_told_with_axis_and_gain() -> None:
    wild = _with_gains(Robot.load("six_axis"), "axis_3", speed_gain=4.0)
    with pytest.raises(ConfigurationError, match=r"axis_3: the controller is unstable.*speed_gain 4"):
        wild.simulate(np.zeros((1, 10, 6)), POSE[None])


@pytest.mark.parametrize("gain", [0.5, 0.8, 1.6, 3.0])
def test_what_is_refused_grows_in_the_simulation_and_what_is_not_does_not(gain: float) -> None:
    # Speed control of one motor, quiet sensors, no friction, no torque limit within reach: a small push grows or dies.
    robot = Robot.load("one_axis")
    axis = robot.description.axes[robot.axis_names[0]]
    quiet: dict[str, Any] = {
        "friction": axis.friction.model_copy(update={"coulomb": 0.0}),
        "sensors": axis.sensors.model_copy(update={"encoder_counts": 0.0}),
        "torque_limit": 1e9,
    }
    robot = replace(
        robot,
        description=robot.description.model_copy(
            update={"axes": {robot.axis_names[0]: axis.model_copy(update=quiet)}}
        ),
    )
    edge = axis.rotor_inertia / robot.sample_time_s  # a rotor alone: the speed error is undone in one sample
    robot = _with_gains(robot, robot.axis_names[0], speed_gain=gain * edge)
    push = np.zeros((1, 400, 1))
    push[0, 0] = 1e-6
    state = standing(robot, np.zeros((1, 1)))
    try:
        run = continue_simulation(robot, state, np.zeros((1, 400, 1)), None, torque_feedforward=push)
        speed = abs(np.diff(run.position[0, :, 0]))
        grown = speed[-50:].max() > speed[:50].max()
    except SimulationDiverged:
        grown = True
    try:
        refuse_unstable(robot, np.zeros(1), robot.step_s, "implicit_midpoint")
        refused = False
    except ConfigurationError:
        refused = True
    assert refused == grown


def test_a_step_too_long_for_the_stiffest_spring_is_told_with_place_and_number() -> None:
    stiff = Robot.load("six_axis").with_parameters({"gear_stiffness.axis_6": 8.0e6})
    with pytest.raises(
        ConfigurationError, match=r"step_s 0.001 s is too long for the spring at '\S*axis_6'.*give at most"
    ):
        stiff.simulate(np.zeros((1, 10, 6)), POSE[None], step=1e-3, method="runge_kutta")
    stiff.simulate(np.zeros((1, 10, 6)), POSE[None])


def test_the_explicit_step_that_is_refused_explodes_and_the_one_advised_does_not() -> None:
    robot = Robot.load("six_axis").with_parameters(
        {"gear_stiffness.axis_6": 8.0e6, "gear_damping.axis_6": 0.0}
    )
    with pytest.raises(ConfigurationError, match="give at most") as caught:
        refuse_unstable(robot, POSE, 1e-3, "runge_kutta")
    advised = float(str(caught.value).rpartition("give at most ")[2].split()[0])
    state = standing(robot, robot.motor_angle(POSE)[None])
    reference = np.full((1, 200, 6), 0.5)
    fine = 1e-3 / np.ceil(1e-3 / advised)
    continue_simulation(robot, state, reference, None, step=fine, method="runge_kutta")
    with pytest.raises(SimulationDiverged, match=r"left all bounds at .*axis_6"):
        continue_simulation(robot, state, reference, None, step=1e-3, method="runge_kutta")
