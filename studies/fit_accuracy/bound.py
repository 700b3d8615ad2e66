"""The bound: inverse information of all unknowns that the fit frees, at the truth, with the generator's noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from robid_core import FloatArray, FreeParameters, Robot
from robid_core.estimation.torque.periodic import PeriodicMotion
from robid_core.estimation.torque.weights import whitener
from robid_core.residual import TorqueProblem
from robid_core.residual.block import TorqueBlock
from robid_core.residual.impedance import impedance


def bound(problem: TorqueProblem, true: Robot, torque_noise: FloatArray, names: list[str]) -> FloatArray:
    """Standard deviations that no unbiased estimate stays below, relative, shape (n_name,).

    Parameters
    ----------
    problem
        As the fit sets it up.
    true
        The plant's robot.
    torque_noise
        White, of the measured torque, N m, shape (n_axis,).
    names
        Logarithmic parameters.
    """
    levels = {
        name: 0.0
        for name in true.layout
        if name.startswith("friction.") and name.endswith((".coulomb", ".offset"))
    }
    bare = true.with_parameters(levels)
    free = FreeParameters.of_robot(bare, problem.free.names)
    values = bare.parameters()  # a payload that the block's robot has besides stays
    blocks = tuple(replace(block, robot=block.robot.with_parameters(values)) for block in problem.blocks)
    there = TorqueProblem(free, blocks, problem.friction_names)
    point = np.zeros(there.n_unknown)
    weights = [whitener(_noise(block, torque_noise)) for block in blocks]
    about = there.linearise(point, there.weightings(point, weights))
    deviation = np.sqrt(np.diag(np.linalg.inv(about.whole)))
    return np.array([deviation[free.names.index(name)] for name in names])


def _noise(block: TorqueBlock, torque_noise: FloatArray) -> npt.NDArray[np.complex128]:
    """Covariance of the spectra of the residual, mean over poses, shape (n_bin, n_axis, n_axis)."""
    motion, robot = block.motion, block.robot
    n_period = motion.torque_deviation.shape[2] if isinstance(motion, PeriodicMotion) else 1
    drives = robot.description.axes.values()
    step = np.array(
        [2 * np.pi / axis.sensors.encoder_counts if axis.sensors.encoder_counts else 0.0 for axis in drives]
    )
    angle = np.array([axis.sensors.position_noise for axis in drives]) ** 2 + step**2 / 12
    z = impedance(robot, block.angle, motion, "zero_order_hold") * (motion.omega**2)[:, None, None]
    moved = np.einsum("cfab,b,cfdb->fad", z, angle, z.conj()) / len(z)
    covariance: npt.NDArray[np.complex128] = (moved + np.diag(torque_noise**2)) / (motion.n_sample * n_period)
    return covariance
