"""What white noise of the motors' angles does to a residual: it takes torque, and sensors should show it."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.residual.arm_sensors import ArmSpectra
from robid_core.residual.impedance import impedance
from robid_core.robot import Robot


def noise_of_angles(
    robot: Robot, angle: FloatArray, motion: MotionSpectra, arm: ArmSpectra | None, variance: FloatArray
) -> ComplexArray:
    """Covariance of torques, then of sensors behind the gears, mean over configurations, (n_bin, n_row, n_row).

    Parameters
    ----------
    angle
        Joint-side angles about which the robot is linear, rad, (n_config, n_axis).
    variance
        Of each motor angle at a sample, rad^2, (n_axis,).
    """
    rows = impedance(robot, angle, motion) * (motion.omega**2)[:, None, None]
    if arm is not None:
        omega = np.concatenate((motion.omega[1:2], motion.omega[1:]))
        rows = np.concatenate((rows, -arm.follow(robot, angle, omega)), axis=2)
    covariance: ComplexArray = np.einsum("cfab,b,cfdb->fad", rows, variance, rows.conj())
    return covariance / (len(rows) * motion.n_sample)
