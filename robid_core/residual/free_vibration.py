"""Free vibration behind held motors: the torque that unknown initial deflections and their rates add.

Deviations of the initial state, s, become ``T(t) = G V exp(L t) V^-1 s`` with eigenvalues L and
eigenvectors V of the linear model at the initial pose, and G the torque on the motors of each state.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.mechanics import SimulationState
from robid_core.residual.columns import passive_motion
from robid_core.residual.windowed_arm import SLOW, WindowedArm
from robid_core.robot import Robot


def free_vibration(robot: Robot, motion: WindowedMotion, arm: WindowedArm | None = None) -> ComplexArray:
    """Spectra of the held torque, and of sensors behind the gears, for unit deviations of angles, then rates.

    Shape (n_config, n_exp, n_bin, n_row, 2 n_behind): experiments start in poses of their own.
    """
    start = motion.angle[:, :, 0]
    torques = vibration_about(robot, robot.joint_angle(start).reshape(-1, robot.n_axis), motion, arm)
    return torques.reshape(*start.shape[:2], *torques.shape[1:])


def vibration_about(
    robot: Robot, angle: FloatArray, motion: WindowedMotion, arm: WindowedArm | None = None
) -> ComplexArray:
    """Likewise about joint-side angles, (n_pose, n_axis); (n_pose, n_bin, n_row, 2 n_behind)."""
    n, model = robot.n_axis, robot.second_order(angle)
    push = [getattr(model, name)[:, :n, n:] for name in ("stiffness", "damping", "mass")]
    flow = _behind(robot, angle)
    acceleration = flow[:, flow.shape[1] // 2 :]
    value, vector = np.linalg.eig(flow)
    torque = np.concatenate((push[0], push[1]), axis=2) + push[2] @ acceleration
    time = motion.sample_time_s * np.arange(motion.n_sample)
    wave = np.exp(value[:, None, None, :] * time[:, None])
    shown = (motion.spectrum_of(wave.real) + 1j * motion.spectrum_of(wave.imag))[:, 0]
    modes = (torque @ vector)[:, None] * (shown / motion.hold[:, None])[:, :, None]
    if arm is not None:
        modes = np.concatenate(
            (modes, (arm.of_state(robot, angle, acceleration) @ vector)[:, None] * shown[:, :, None]), axis=2
        )
    torques: ComplexArray = modes @ np.linalg.inv(vector)[:, None]
    return torques


def slowest_decay(robot: Robot, angle: FloatArray) -> float:
    """Rate, 1/s, with which the slowest vibration behind held motors dies away about joint-side angles."""
    return float(-np.linalg.eigvals(_behind(robot, angle)).real.max())


def _behind(robot: Robot, angle: FloatArray) -> FloatArray:
    """Matrix of the state behind held motors, angles and rates, (n_pose, 2 n_behind, 2 n_behind)."""
    n, model = robot.n_axis, robot.second_order(angle)
    mass, damping, stiffness = (getattr(model, name)[:, n:, n:] for name in ("mass", "damping", "stiffness"))
    acceleration = -np.linalg.solve(mass, np.concatenate((stiffness, damping), axis=2))
    rate = np.concatenate((np.zeros_like(mass), np.broadcast_to(np.eye(mass.shape[1]), mass.shape)), axis=2)
    flow: FloatArray = np.concatenate((rate, acceleration), axis=1)
    return flow


def rms_vibration(robot: Robot, angle: FloatArray, motion: WindowedMotion) -> FloatArray:
    """Rms of the linear model's dynamic deflection in this motion, and of its rate, shape (n_config, 2 n_behind)."""
    n, omega = robot.n_axis, motion.omega[1:]
    follow = passive_motion(robot, angle, np.concatenate((omega[:1] / SLOW, omega)))[:, :, n:]
    dynamic = follow[:, 1:] - follow[:, :1]
    deflection = np.matmul(dynamic[:, None], motion.angle_spectrum[:, :, 1:, :, None])[..., 0]
    power = [2 * (np.abs(f * deflection) ** 2).sum(axis=2).mean(axis=1) for f in (1.0, omega[:, None])]
    rms: FloatArray = np.sqrt(np.concatenate(power, axis=1))
    return rms


def deviation_of(
    residual: ComplexArray, vibration: ComplexArray, whitener: ComplexArray, prior: FloatArray
) -> FloatArray:
    """Deviations of the initial state that explain residuals best, shape (n_config, n_exp, 2 n_behind).

    Parameters
    ----------
    residual
        Torque, N m, shape (n_config, n_exp, n_bin, n_axis).
    vibration
        From `free_vibration`.
    whitener
        Shape (n_bin, n_axis, n_axis).
    prior
        Standard deviation of each, from `rms_vibration`.
    """
    white = np.matmul(whitener, vibration * prior[:, None, None, None])
    rows = np.concatenate((white.real, white.imag), axis=2).reshape(
        *vibration.shape[:2], -1, vibration.shape[-1]
    )
    error = np.matmul(whitener, residual[..., None])[..., 0]
    values = np.concatenate((error.real, error.imag), axis=2).reshape(*residual.shape[:2], -1, 1)
    turned = rows.swapaxes(-1, -2)
    share: FloatArray = np.linalg.solve(turned @ rows + np.eye(rows.shape[-1]), turned @ values)[..., 0]
    return share * prior[:, None]


def state_at_first(
    robot: Robot, angle: FloatArray, speed: FloatArray, deviation: FloatArray | None
) -> SimulationState:
    """State at the first sample of everything: bent by gravity, moving along, and what deviates from that.

    Motor angles and speeds have shape (n_lane, n_axis); `deviation` is of angles and rates behind the motors, shape
    (n_config, n_exp, 2 n_behind).
    """
    n, state = robot.n_axis, robot.standing(robot.joint_angle(angle))
    state = state.moving(robot.mechanism, speed)
    if deviation is None:
        return state
    bent, rate = np.split(deviation.reshape(len(state.position), -1), 2, axis=1)
    position, moving = state.position.copy(), state.speed.copy()
    position[:, n:] += bent
    moving[:, n:] += rate
    return replace(state, position=position, speed=moving)
