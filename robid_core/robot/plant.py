"""The robot in simulated closed loop: for stages that predict, and as the plant behind simulated drives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from robid_core.mechanics import Controller, Friction, Simulation, SimulationState, rest_state, simulate

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

FloatArray = npt.NDArray[np.float64]


def controller_of(robot: Robot) -> Controller:
    """Gains and limits of the drives' cascade."""
    d = robot.drives
    counts = np.where(d.encoder_counts > 0, d.encoder_counts, 1.0)
    encoder_step = np.where(d.encoder_counts > 0, 2 * np.pi / counts, 0.0)
    return Controller(
        d.speed_gain, d.integral_gain, d.position_gain, d.speed_feedforward, d.torque_limit, encoder_step
    )


def friction_of(robot: Robot) -> Friction:
    """Coulomb, viscous and constant friction of the motors."""
    d = robot.drives
    return Friction(d.coulomb, d.viscous, d.friction_speed, d.friction_offset)


def sensor_noise(
    robot: Robot, shape: tuple[int, int, int], seed: int | None
) -> tuple[FloatArray, FloatArray]:
    """Noise of measured position (rad) and torque (N m), shape (n_lane, n_sample, n_axis); zero without a seed."""
    if seed is None:
        return np.zeros(shape), np.zeros(shape)
    generator = np.random.Generator(np.random.PCG64(seed))
    d = robot.drives
    position = generator.standard_normal(shape) * d.position_noise
    return position, generator.standard_normal(shape) * d.torque_noise


def simulate_robot(
    robot: Robot,
    speed_reference: FloatArray,
    angle: FloatArray,
    seed: int | None = None,
    position_reference: FloatArray | None = None,
) -> Simulation:
    """Closed loop from rest at the gravity equilibrium; see `Robot.simulate`."""
    stiffness, _ = robot.spring_arrays()
    state = rest_state(robot.mechanism, stiffness, robot.motor_angle(angle))
    return continue_simulation(robot, state, speed_reference, seed, position_reference)


def continue_simulation(
    robot: Robot,
    state: SimulationState,
    speed_reference: FloatArray,
    seed: int | None,
    position_reference: FloatArray | None = None,
) -> Simulation:
    """Closed loop from any state, one lane per row of `speed_reference`."""
    stiffness, damping = robot.spring_arrays()
    reference = np.ascontiguousarray(speed_reference, dtype=float)
    n_lane, n_sample, n_axis = reference.shape
    position_noise, torque_noise = sensor_noise(robot, (n_lane, n_sample, n_axis), seed)
    return simulate(
        robot.mechanism,
        stiffness,
        damping,
        controller_of(robot),
        friction_of(robot),
        state,
        reference,
        position_reference=position_reference,
        position_noise=position_noise,
        torque_noise=torque_noise,
        sample_time=robot.sample_time_s,
        step=robot.step_s,
    )


class RobotPlant:
    """A robot behind simulated drives, stepped in simulated time (the `Plant` of drives.py)."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.n_axis = robot.n_axis
        self._state: SimulationState | None = None

    def rest(self, motor_angle: FloatArray) -> None:
        """Stand still at these motor angles (rad, shape (n_axis,)), gravity held by the springs and motors."""
        stiffness, _ = self.robot.spring_arrays()
        self._state = rest_state(self.robot.mechanism, stiffness, np.asarray(motor_angle, dtype=float)[None])

    def track(self, speed_reference: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
        """Follow a speed reference (n_sample, n_axis) from the present state; returns (position, torque)."""
        if self._state is None:
            raise RuntimeError("the plant stands nowhere yet: call rest() first")
        result = continue_simulation(self.robot, self._state, speed_reference[None], seed)
        self._state = result.state
        return result.position[0], result.torque[0]
