"""What noise alone would leave of the torque that a right model predicts in open loop: no model can do better.

Noise of angles comes through inertia and springs, twice differentiated, and is most of it where the band is wide.
Differences between periods tell it; of motions that do not repeat nothing is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid_core import FloatArray, RobidError, Robot
from robid_core.residual import PeriodicBlock
from robid_diagnosis.comparison import ORDER, Signals
from robid_diagnosis.hypothesis import Case, Hypothesis
from robid_diagnosis.prediction_runs import Piece

BEYOND = 1.5  # times the band: what the low-pass lets through above it


def noise_left(
    pieces: Sequence[Piece], robots: Mapping[str, Robot], measured: Signals, highest_hz: float
) -> FloatArray | None:
    """Return the sum of squares that noise leaves in all that is compared, (n_axis,); None where nothing tells it.

    Parameters
    ----------
    pieces
        Parts of records that are judged.
    robots
        The model of each variant.
    measured
        Torques of each run of these parts, one after another, (n_lane, n_sample, n_axis) each.
    highest_hz
        Of the band that is compared.
    """
    total, place = np.zeros(next(iter(robots.values())).n_axis), 0
    for piece in pieces:
        runs = measured[place : place + len(piece.record.runs)]
        place += len(runs)
        try:
            share = _share(piece, robots[piece.variant], highest_hz)
        except RobidError:  # too short for the band, for instance: a prediction needs no noise
            return None
        if share is None:
            return None
        total += share * sum(((one - one.mean(axis=1, keepdims=True)) ** 2).sum(axis=(0, 1)) for one in runs)
    return total if total.any() else None


def _share(piece: Piece, robot: Robot, highest_hz: float) -> FloatArray | None:
    """Power of the noise over that of the torque, the mean of both left out, (n_axis,); None without periods."""
    widest = min(BEYOND * highest_hz, *(0.45 / run.sample_time_s for run in piece.record.runs))
    case = Case((piece.record,), robot, {}, widest, 0, 1, 0.0, robots={piece.variant: robot})
    problem = case.problem(Hypothesis(), case.records)
    size = problem.friction_size(case.told_point(problem))
    noise, power = np.zeros((2, robot.n_axis))
    for block in problem.blocks:
        if not isinstance(block, PeriodicBlock):
            return None
        spectrum = block.motion.torque_spectrum
        passed = 1 / (1 + (block.motion.frequency_hz[1:, None] / highest_hz) ** (2 * ORDER)) ** 2
        variance = np.einsum("faa->fa", block.measured_noise(robot, size)).real[1:, : robot.n_axis]
        one = (passed * variance).sum(axis=0)
        noise += one * np.prod(block.motion.torque_deviation.shape[:3])  # of each period, not of their mean
        power += (passed * np.abs(spectrum[:, :, 1:]) ** 2).sum(axis=(0, 1, 2))
    share: FloatArray = noise / power
    return share
