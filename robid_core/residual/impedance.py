"""Inverse of the linear model's response: motor torque per motor acceleration, at the bins of a record."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.spectra import Hold, MotionSpectra
from robid_core.robot import Robot


def impedance(
    robot: Robot, angle: FloatArray, motion: MotionSpectra, hold: Hold | None = None
) -> ComplexArray:
    """Motor torque per motor acceleration at each bin, (n_config, n_bin, n_axis, n_axis), zero at bin 0.

    Of what acts and what moves: laws on signals are not in it. `hold` says how torques go between samples; None: as
    the recorded one does.
    """
    held = robot.sample_time_s if (hold or motion.torque_hold) == "zero_order_hold" else None
    response: Any = robot.batches.response(robot.second_order(angle), motion.omega[1:], held)
    n_config, _, n_axis, _ = response.shape
    found = np.zeros((n_config, len(motion.bin), n_axis, n_axis), dtype=np.complex128)
    found[:, 1:] = np.linalg.inv(response)
    return found
