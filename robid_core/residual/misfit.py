"""Misfit: weighted residual per degree of freedom against the noise, in all and by axis and band."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import MisfitTable
from robid_core.estimation.torque.weights import whitener
from robid_core.residual.block import TorqueBlock
from robid_core.residual.problem import TorqueProblem
from robid_core.residual.weighting import Weighting
from robid_core.robot import Robot

EDGES_HZ = (0.0, 3.0, 10.0, 25.0, 50.0, 100.0)  # of the bands: friction and load, arm, gears, above


def misfit(problem: TorqueProblem, point: FloatArray) -> float:
    """One where model and noise are right; corrected for few periods."""
    total = count = 0.0
    size, robots = problem.friction_size(point), problem.robots(point)
    for block, robot, residual in zip(problem.blocks, robots, problem.residuals(point), strict=True):
        weight = Weighting.of_block(
            _without_mean(whitener(block.noise(robot, size))),
            block.free_vibration(robot),
            block.used,
            block.moving,
        )
        total += (weight.residual(residual) ** 2).sum() * _correction(block)
        count += block.share[_used(block)][:, 1:].sum()
    return float(total / count)


def power_in_noise(
    block: TorqueBlock[Any], robot: Robot, coefficient: FloatArray, residual: ComplexArray
) -> FloatArray:
    """Mean power of a residual (n_config, n_exp, n_bin, n_row) over that of the noise, (n_config, n_exp)."""
    noise = np.einsum("faa->fa", block.noise(robot, coefficient)).real
    power: FloatArray = (np.abs(residual) ** 2 / noise)[:, :, 1:].mean(axis=(2, 3))
    return power


def misfit_table(problem: TorqueProblem, point: FloatArray) -> MisfitTable:
    """By axis and band: power of the residual over that of the noise, lines and other bins apart."""
    highest = max(block.motion.frequency_hz[-1] for block in problem.blocks)
    edges = np.array([*(edge for edge in EDGES_HZ if edge < highest), highest * (1 + 1e-9)])
    axes = problem.free.robot.axis_names
    names = (*axes, *(f"{one.channel}.{axes[one.axis]}" for one in problem.sensors))
    n_row, n_band = len(names), len(edges) - 1
    total, count = np.zeros((2, n_row, n_band)), np.zeros((2, n_row, n_band))
    size, robots = problem.friction_size(point), problem.robots(point)
    for block, robot, residual in zip(problem.blocks, robots, problem.residuals(point), strict=True):
        noise = np.einsum("faa->fa", block.noise(robot, size)).real
        counted, share = block.counted(residual)[_used(block)], block.share[_used(block)].sum(axis=0)
        ratio = (np.abs(counted) ** 2 / noise * _correction(block)).sum(axis=0)
        band = np.searchsorted(edges, block.motion.frequency_hz, side="right") - 1
        for which, bins in enumerate((block.motion.excited, ~block.motion.excited)):
            for b in range(n_band):
                chosen = bins & (band == b) & (block.motion.bin > 0)
                total[which, :, b] += ratio[chosen].sum(axis=0)
                count[which, :, b] += share[chosen].sum(axis=0)
    values = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
    return MisfitTable(names, edges, values[0], values[1])


def _used(block: TorqueBlock[Any]) -> npt.NDArray[np.bool_]:
    """Experiments that count, (n_config, n_exp)."""
    return np.ones(block.measured.shape[:2], dtype=bool) if block.used is None else block.used


def _without_mean(whitener: ComplexArray) -> ComplexArray:
    return np.concatenate((np.zeros_like(whitener[:1]), whitener[1:]))


def _correction(block: TorqueBlock[Any]) -> float:
    """What few periods add to the mean of an inverse estimated covariance, taken off."""
    freedom = block.noise_freedom
    return (freedom - block.measured.shape[-1]) / freedom if np.isfinite(freedom) else 1.0
