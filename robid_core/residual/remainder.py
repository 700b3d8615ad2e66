"""What the linear model leaves out of the torque: moving inertia, gravity along the motion, nonlinear springs.

The motors are moved as measured (`Robot.prescribe`), without friction at the motors but its viscous part; the torque
that takes less that of the linear model at the mean angles is the remainder. Both are of a smooth motion between the
samples, so that what a held torque does there cancels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from robid_core.estimation.torque.spectra import MotionSpectra, PeriodicMotion
from robid_core.mechanics import MotorMotion, SimulationState, mean_over_held, periodic_motion
from robid_core.residual.columns import passive_motion
from robid_core.robot import Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

HIGHEST_HZ = 250.0  # of the motion that is prescribed; above it angles are noise
FIRST_PERIODS = 3  # until it has rung out, from the linear motion
NEXT_PERIODS = 2  # likewise, from where the last run ended


def impedance(robot: Robot, angle: FloatArray, motion: MotionSpectra, hold: str) -> ComplexArray:
    """Motor torque per motor acceleration at each bin, (n_config, n_bin, n_axis, n_axis), zero at bin 0."""
    response = robot.response(angle, motion.frequency_hz[1:], hold=hold)
    n_config, _, n_axis, _ = response.shape
    found = np.zeros((n_config, len(motion.frequency_hz), n_axis, n_axis), dtype=np.complex128)
    found[:, 1:] = np.linalg.inv(response)
    return found


def remainder(
    robot: Robot, angle: FloatArray, motion: PeriodicMotion, state: SimulationState | None = None
) -> tuple[ComplexArray, SimulationState]:
    """Return the spectra of the remainder, (n_config, n_exp, n_bin, n_axis), and the state that the run ended in.

    Parameters
    ----------
    robot
        Without Coulomb friction at the motors.
    angle
        Joint-side angles about which it is linearised, shape (n_config, n_axis).
    motion
        What was measured.
    state
        Where an earlier run with nearly the same robot ended; None: what the linear model does.
    """
    n_config, n_exp, n_sample, n_axis = motion.angle.shape
    whole = periodic_motion(
        motion.angle.reshape(-1, n_sample, n_axis), motion.sample_time_s, robot.step_s, HIGHEST_HZ
    )
    periods = FIRST_PERIODS if state is None else NEXT_PERIODS
    start = linear_state(robot, angle, motion, whole) if state is None else state
    run = robot.prescribe(replace(whole, acceleration=np.tile(whole.acceleration, (1, periods, 1))), start)
    n_bin = len(motion.bin)
    torque = np.fft.rfft(run.torque[:, -n_sample:], axis=1)[:, motion.bin] / n_sample
    torque /= mean_over_held(motion.frequency_hz, motion.sample_time_s, robot.step_s)[:, None]
    smooth = impedance(robot, angle, motion, "continuous") / motion.hold[:, None, None]
    linear = np.einsum("cfab,cxfb->cxfa", smooth, motion.acceleration_spectrum)
    left: ComplexArray = torque.reshape(n_config, n_exp, n_bin, n_axis) - linear
    return left, run.state


def linear_state(
    robot: Robot, angle: FloatArray, motion: PeriodicMotion, whole: MotorMotion
) -> SimulationState:
    """State at the first sample of everything behind the motors, in the periodic motion of the linear model."""
    state = robot.standing(robot.joint_angle(whole.angle)).moving(robot.mechanism, whole.speed)
    n_config, n_exp, _, n_axis = motion.angle.shape
    rest = robot.equilibrium(angle).position
    per_motor = passive_motion(robot, angle, motion.omega[1:])
    swing = np.einsum("cfna,cxfa->cxfn", per_motor[:, :, n_axis:], motion.angle_spectrum[:, :, 1:])
    behind = rest[:, None, n_axis:] + 2 * swing.real.sum(axis=2)
    rate = 2 * (1j * motion.omega[1:, None] * swing).real.sum(axis=2)
    position, speed = state.position.copy(), state.speed.copy()
    position[:, n_axis:] = behind.reshape(n_config * n_exp, -1)
    speed[:, n_axis:] = rate.reshape(n_config * n_exp, -1)
    return replace(state, position=position, speed=speed)
