"""The robot in simulated closed loop: for stages that predict, and as the plant behind simulated drives."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.effect import SignalEffect
from robid_core.mechanics import (
    Controller,
    Simulation,
    SimulationState,
    rest_state,
    simulate,
)
from robid_core.robot.stability import refuse_unstable

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

IMPLICIT = "implicit_midpoint"


def controller_of(robot: Robot) -> Controller:
    """Gains and limits of the drives' cascade."""
    d = robot.drives
    return Controller(
        d.speed_gain,
        d.integral_gain,
        d.position_gain,
        d.speed_feedforward,
        d.torque_limit,
        _encoder_step(robot),
        d.back_emf,
    )


def _encoder_step(robot: Robot) -> FloatArray:
    """Angle of one count of each encoder, rad; 0 where it is not quantised."""
    counts = robot.drives.encoder_counts
    step: FloatArray = np.where(counts > 0, 2 * np.pi / np.where(counts > 0, counts, 1.0), 0.0)
    return step


def sensor_noise(
    robot: Robot, shape: tuple[int, ...], seed: int | None
) -> tuple[FloatArray | None, FloatArray | None]:
    """Noise of measured position (rad) and torque (N m), shape (n_lane, n_sample, n_axis); None without a seed.

    White noise of the sensors first, then what the effects draw, in the order of the robot file.
    """
    if seed is None:
        return None, None
    generator = np.random.Generator(np.random.PCG64(seed))
    d = robot.drives
    position = generator.standard_normal(shape) * d.position_noise
    torque = generator.standard_normal(shape) * d.torque_noise
    for bound in robot.effects:
        if issubclass(bound.effect, SignalEffect):
            place = bound.place
            drawn = bound.effect.draw(bound.parameters, place, (shape[0], shape[1]), generator)
            if drawn is not None:
                (position if place.side == "position" else torque)[..., place.axis] += drawn
    return position, torque


def simulate_robot(
    robot: Robot,
    speed_reference: FloatArray,
    angle: FloatArray,
    seed: int | None = None,
    position_reference: FloatArray | None = None,
    **options: Any,
) -> Simulation:
    """Closed loop from rest at the gravity equilibrium; see `Robot.simulate`."""
    if "step" in options:  # laws are laid out for the step that is run
        step = float(options.pop("step"))
        robot = replace(robot, description=robot.description.model_copy(update={"step_s": step}))
    check_once(robot, angle[0], str(options.get("method", IMPLICIT)))
    state = standing(robot, robot.motor_angle(angle))
    return continue_simulation(robot, state, speed_reference, seed, position_reference, **options)


def check_once(robot: Robot, angle: FloatArray, method: str = IMPLICIT) -> None:
    """Refuse an unstable controller and a step too long, at the first configuration that a robot is simulated in."""
    checked = robot.__dict__.setdefault("_checked_methods", set())
    if method not in checked:
        refuse_unstable(robot, angle, robot.step_s, method)
        checked.add(method)


def standing(robot: Robot, motor_angle: FloatArray) -> SimulationState:
    """Robots that stand still at these motor angles (n_lane, n_axis), gravity held by springs and motors."""
    stiffness, _ = robot.spring_arrays()
    return rest_state(robot.mechanism, stiffness, motor_angle, robot.forces, robot.signals)


def drive_open_loop(robot: Robot, torque: FloatArray, state: SimulationState, **options: Any) -> Simulation:
    """Motion under given motor torques (n_lane, n_sample, n_axis), no controller; see `Robot.drive`."""
    push = np.ascontiguousarray(torque, dtype=float)
    none = np.zeros(robot.n_axis)
    unlimited = np.full(robot.n_axis, np.finfo(float).max)
    passive = Controller(none, none, none, none, unlimited, _encoder_step(robot), none)
    free = replace(
        state, holding_torque=np.zeros_like(state.holding_torque), integral=np.zeros_like(state.integral)
    )
    return _run(robot, passive, free, np.zeros_like(push), torque_feedforward=push, **options)


def continue_simulation(
    robot: Robot,
    state: SimulationState,
    speed_reference: FloatArray,
    seed: int | None,
    position_reference: FloatArray | None = None,
    **options: Any,
) -> Simulation:
    """Closed loop from any state, one lane per row of `speed_reference`."""
    reference = np.ascontiguousarray(speed_reference, dtype=float)
    position_noise, torque_noise = sensor_noise(robot, reference.shape, seed)
    return _run(
        robot,
        controller_of(robot),
        state,
        reference,
        position_reference=position_reference,
        position_noise=position_noise,
        torque_noise=torque_noise,
        **options,
    )


def _run(
    robot: Robot, controller: Controller, state: SimulationState, speed_reference: FloatArray, **options: Any
) -> Simulation:
    stiffness, damping = robot.spring_arrays()
    settings = {"sample_time": robot.sample_time_s, "step": robot.step_s, **options}
    return simulate(
        robot.mechanism,
        stiffness,
        damping,
        controller,
        state,
        speed_reference,
        forces=robot.forces,
        signals=robot.signals,
        **settings,
    )


class RobotPlant:
    """A robot behind simulated drives, stepped in simulated time (the `Plant` of drives.py)."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.n_axis = robot.n_axis
        self._state: SimulationState | None = None

    def rest(self, motor_angle: FloatArray) -> None:
        """Stand still at these motor angles (rad, shape (n_axis,)), gravity held by the springs and motors."""
        check_once(self.robot, self.robot.joint_angle(motor_angle))
        self._state = standing(self.robot, np.asarray(motor_angle, dtype=float)[None])

    def track(self, speed_reference: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
        """Follow a speed reference (n_sample, n_axis) from the present state; returns (position, torque)."""
        if self._state is None:
            raise RuntimeError("the plant stands nowhere yet: call rest() first")
        result = continue_simulation(self.robot, self._state, speed_reference[None], seed)
        self._state = result.state
        return result.position[0], result.torque[0]
