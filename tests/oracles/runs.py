"""Runs of robid's own simulator for checks: from any state, by either method, at any step.

The one place of these checks that knows how the simulator is called.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from oracles.drives import Cascade, Ripple

from robid_core import Robot
from robid_core.mechanics import Simulation, SimulationState, rest_state, simulate
from robid_core.robot.plant import controller_of

FloatArray = npt.NDArray[np.float64]
Method = Literal["implicit_midpoint", "runge_kutta"]


def at_rest(robot: Robot, angle: npt.ArrayLike) -> SimulationState:
    """State of lanes that rest at joint-side motor angles (n_lane, n_axis), gravity held."""
    stiffness, _ = robot.spring_arrays()
    motor = robot.motor_angle(np.atleast_2d(angle))
    return rest_state(robot.mechanism, stiffness, motor, robot.forces, robot.signals)


def measured_at_rest(robot: Robot, state: SimulationState, ripple: Ripple) -> SimulationState:
    """State whose last measured angles, before the start, are those that the sensors show at rest."""
    measured = [Cascade(robot, angle, angle, ripple).last for angle in state.position[:, : robot.n_axis]]
    return replace(state, measured=np.array(measured))


def moving(
    robot: Robot,
    position: FloatArray,
    speed: FloatArray,
    torque: FloatArray,
    acceleration: FloatArray | None = None,
) -> SimulationState:
    """State of one lane at generalised coordinates (n_coordinate,), its drives holding `torque` (n_axis,).

    The acceleration is what the first step of the implicit method extrapolates with; left out, zero.
    """
    motor = position[None, : robot.n_axis]
    start = at_rest(robot, robot.joint_angle(motor))
    first = np.zeros_like(position) if acceleration is None else acceleration
    return replace(
        start,
        position=position[None],
        speed=speed[None],
        acceleration=first[None],
        holding_torque=torque[None],
    )


def run(
    robot: Robot,
    state: SimulationState,
    speed_reference: FloatArray,
    *,
    method: Method = "implicit_midpoint",
    n_step: int | None = None,
    torque_feedforward: FloatArray | None = None,
    keep_coordinates: bool = False,
) -> Simulation:
    """Closed loop from a state, reference (n_lane, n_sample, n_axis), n_step steps a sample."""
    stiffness, damping = robot.spring_arrays()
    state = replace(state, position=state.position.copy(), speed=state.speed.copy())
    return simulate(
        robot.mechanism, stiffness, damping, controller_of(robot), state, speed_reference,
        forces=robot.forces, signals=robot.signals,
        sample_time=robot.sample_time_s,
        step=robot.sample_time_s / n_step if n_step else robot.step_s,
        method=method, torque_feedforward=torque_feedforward, keep_coordinates=keep_coordinates,
    )  # fmt: skip


def free_motion(
    robot: Robot,
    position: FloatArray,
    speed: FloatArray,
    torque: FloatArray,
    n_sample: int,
    acceleration: FloatArray | None = None,
    method: Method = "implicit_midpoint",
    n_step: int | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Motion under constant motor torque, of a robot without feedback (`robots.without_feedback`).

    Returns the coordinates at every sample, (n_sample, n_coordinate), and coordinates with rates after the
    last, (2, n_coordinate).
    """
    state = moving(robot, position, speed, torque, acceleration)
    still = np.zeros((1, n_sample, robot.n_axis))
    done = run(robot, state, still, method=method, n_step=n_step, keep_coordinates=True)
    assert done.coordinates is not None
    return done.coordinates[0], np.stack((done.state.position[0], done.state.speed[0]))
