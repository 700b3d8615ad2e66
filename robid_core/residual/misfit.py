"""Misfit: weighted residual per degree of freedom against the noise, in all and by axis and band."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import MisfitTable
from robid_core.estimation.torque.weights import whitener
from robid_core.residual.block import TorqueBlock
from robid_core.residual.moving_samples import fading
from robid_core.residual.problem import TorqueProblem
from robid_core.residual.weighting import Weighting
from robid_core.robot import Robot

LEFT = 0.2  # of a misfit, at most, without the turns of axes that are held there
EDGES_HZ = (0.0, 3.0, 10.0, 25.0, 50.0, 100.0)  # of the bands: friction and load, arm, gears, above


def explained_by_turns(without: float, counted: float) -> bool:
    """Whether samples at which axes turn back make most of a misfit: without them next to nothing is left.

    Of axes that friction holds there although their angles are too coarse to show it. `counted`: what is left with
    them; both as of `faded_misfit`.

    >>> explained_by_turns(1.2, 74.0), explained_by_turns(1.2, 3.0)
    (True, False)
    """
    return without <= LEFT * counted


def misfit(problem: TorqueProblem, point: FloatArray) -> float:
    """One where model and noise are right; corrected for few periods."""
    return _misfit(problem, point, faded=False)


def faded_misfit(problem: TorqueProblem, point: FloatArray) -> float:
    """Likewise, with the upper half of the band counting less and less, as beside weights over time, in all rows."""
    return _misfit(problem, point, faded=True)


def _misfit(problem: TorqueProblem, point: FloatArray, *, faded: bool) -> float:
    total = count = 0.0
    size, robots = problem.friction_size(point), problem.robots(point)
    for block, robot, residual in zip(problem.blocks, robots, problem.residuals(point), strict=True):
        weight = Weighting.of_block(
            _without_mean(whitener(block.noise(robot, size))),
            block.free_vibration(robot),
            block.used,
            block.moving,
        )
        n_config, n_exp, n_bin, n_row = residual.shape
        fade = np.ones((n_config, n_exp, n_bin, n_row))
        if faded:
            fade *= fading(n_bin)[:, None]
            if block.moving is not None:
                fade[np.broadcast_to(block.moving.rests[:, :, None], fade.shape)] = 1.0  # is in the weights
        rows = weight.residual(residual).reshape(n_config, n_exp, 2, n_bin, n_row)
        total += ((fade[:, :, None] * rows) ** 2).sum() * _correction(block)
        count += (fade**2 * block.share)[_used(block)][:, 1:].sum()
    return float(total / count)


def power_in_noise(
    block: TorqueBlock[Any], robot: Robot, coefficient: FloatArray, residual: ComplexArray
) -> FloatArray:
    """Mean power of a residual (n_config, n_exp, n_bin, n_row) over that of the noise, (n_config, n_exp)."""
    noise = np.einsum("faa->fa", block.noise(robot, coefficient)).real
    power: FloatArray = _in_noise(block.counted(residual), noise)[:, :, 1:].sum(axis=(2, 3))
    power /= np.maximum(block.share[:, :, 1:].sum(axis=(2, 3)), 1.0)
    return power


def _in_noise(residual: ComplexArray, noise: FloatArray) -> FloatArray:
    """Power over that of the noise, (..., n_bin, n_row); zero where nothing counts, of which there is no noise."""
    power: FloatArray = np.abs(residual) ** 2
    return np.divide(power, noise, out=np.zeros_like(power), where=noise > 0)


def misfit_table(problem: TorqueProblem, point: FloatArray) -> MisfitTable:
    """By axis and band: power of the residual over that of the noise, lines and other bins apart."""
    highest = max(block.motion.frequency_hz[-1] for block in problem.blocks)
    edges = np.array([*(edge for edge in EDGES_HZ if edge < highest), highest * (1 + 1e-9)])
    axes = problem.free.robot.axis_names
    names = (*axes, *(f"{one.channel}.{axes[one.axis]}" for one in problem.sensors))
    total, count, freedom = np.zeros((3, 2, len(names), len(edges) - 1))
    size, robots = problem.friction_size(point), problem.robots(point)
    for block, robot, residual in zip(problem.blocks, robots, problem.residuals(point), strict=True):
        noise = np.einsum("faa->fa", block.noise(robot, size)).real
        power = _in_noise(block.counted(residual)[_used(block)], noise) * _correction(block)
        total += _by_band(block, power.sum(axis=0), edges)
        count += _by_band(block, block.share[_used(block)].sum(axis=0), edges)
        freedom += freedom_of(block, edges)
    values = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
    return MisfitTable(names, edges, *values, *freedom)


def freedom_of(block: TorqueBlock[Any], edges: FloatArray) -> FloatArray:
    """Degrees of freedom of lines and of other bins in each band, (2, n_row, n_band), zero where there is no bin.

    A bin of one axis is a complex number, two of them; what was fitted takes a share of each (`block.share`). Where the
    noise is estimated from periods, the ratio of both powers has an F distribution in place of chi-square: its relative
    variance is ``m / (m - 2)`` times as large for a noise of 2 m degrees of freedom, and it counts as one of so many
    fewer. So far chance alone lets a misfit be from one.
    """
    of_noise = block.noise_freedom
    fewer = max(of_noise - 2.0, 0.0) / of_noise if np.isfinite(of_noise) else 1.0
    return 2 * fewer * _by_band(block, block.share[_used(block)].sum(axis=0), edges)


def _by_band(block: TorqueBlock[Any], values: FloatArray, edges: FloatArray) -> FloatArray:
    """Sums of (n_bin, n_row) over lines and over other bins of each band, the mean left out, (2, n_row, n_band)."""
    band = np.searchsorted(edges, block.motion.frequency_hz, side="right") - 1
    kinds = (block.motion.excited, ~block.motion.excited)
    chosen = [[bins & (band == b) & (block.motion.bin > 0) for b in range(len(edges) - 1)] for bins in kinds]
    return np.array([[values[one].sum(axis=0) for one in own] for own in chosen]).swapaxes(1, 2)


def _used(block: TorqueBlock[Any]) -> npt.NDArray[np.bool_]:
    """Experiments that count, (n_config, n_exp)."""
    return np.ones(block.measured.shape[:2], dtype=bool) if block.used is None else block.used


def _without_mean(whitener: ComplexArray) -> ComplexArray:
    return np.concatenate((np.zeros_like(whitener[:1]), whitener[1:]))


def _correction(block: TorqueBlock[Any]) -> float:
    """What few periods add to the mean of an inverse estimated covariance, taken off."""
    freedom = block.noise_freedom
    left = max(freedom - block.measured.shape[-1], 1.0)  # with fewer the correction is not known either
    return left / freedom if np.isfinite(freedom) else 1.0
