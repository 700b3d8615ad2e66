"""Misfit: weighted residual per degree of freedom against the noise, in all and by axis and band."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robid_core.estimation.torque.weights import HALF_WINDOW, whitener
from robid_core.residual.problem import TorqueProblem

FloatArray = npt.NDArray[np.float64]


def misfit(problem: TorqueProblem, point: FloatArray) -> float:
    """One where model and noise are right; corrected for few periods."""
    total = count = 0.0
    size, robots = problem.friction_size(point), problem.robots(point)
    for block, robot, residual in zip(problem.blocks, robots, problem.residuals(point), strict=True):
        n_config, n_exp, n_period, _, n_axis = block.motion.torque_deviation.shape
        white = np.matmul(whitener(block.noise(robot, size)), residual[..., None])[:, :, 1:, :, 0]
        freedom = n_config * n_exp * (n_period - 1) * (2 * HALF_WINDOW + 1)
        total += (np.abs(white) ** 2).sum() * (freedom - n_axis) / freedom
        count += white.size
    return float(total / count)
