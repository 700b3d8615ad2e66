"""What noise alone would leave of the torque that a right model predicts in open loop: no model can do better.

Noise of angles comes through inertia, springs and friction, twice differentiated, and is most of it where the band is
wide. Of periods their differences show it. Of a motion that does not repeat it is the sensors' noise in the robot file,
or of angles what their spectrum shows where that is more: a draw of it is added, and what that changes is counted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid_core import FloatArray, Record, RobidError, Robot
from robid_core.residual import PeriodicBlock, prescribe_record
from robid_diagnosis.comparison import ORDER, Comparison, Signals
from robid_diagnosis.hypothesis import Case, Hypothesis
from robid_diagnosis.prediction_runs import Piece

BEYOND = 1.5  # times the band: what the low-pass lets through above it


def noise_left(
    pieces: Sequence[Piece],
    robots: Mapping[str, Robot],
    predicted: Signals,
    comparison: Comparison,
    generator: np.random.Generator,
) -> FloatArray | None:
    """Return the sum of squares that noise leaves in all that is compared, (n_axis,); None where nothing tells it.

    Parameters
    ----------
    pieces
        Parts of records that are judged.
    robots
        The model of each variant.
    predicted
        Torques of that model along each run of these parts, one after another, (n_lane, n_sample, n_axis) each.
    comparison
        What of a record is compared.
    generator
        Of the noise that is added to motions which do not repeat.
    """
    total, place = np.zeros(next(iter(robots.values())).n_axis), 0
    for piece in pieces:
        runs = predicted[place : place + len(piece.record.runs)]
        place += len(runs)
        try:
            total += _of_piece(piece, robots[piece.variant], runs, comparison, generator)
        except RobidError:  # too short for the band, or a file without noise: a prediction needs none
            return None
    return total if total.any() else None


def _of_piece(
    piece: Piece, robot: Robot, predicted: Signals, comparison: Comparison, generator: np.random.Generator
) -> FloatArray:
    """Sum of squares that noise leaves in one part, (n_axis,)."""
    widest = min(BEYOND * comparison.highest_hz, *(0.45 / run.sample_time_s for run in piece.record.runs))
    case = Case((piece.record,), robot, {}, widest, 0, 1, 0.0, robots={piece.variant: robot})
    problem = case.problem(Hypothesis(), case.records)
    repeated = [block for block in problem.blocks if isinstance(block, PeriodicBlock)]
    if len(repeated) == len(problem.blocks):
        size = problem.friction_size(case.told_point(problem))
        mean = np.mean([_share(block, robot, size, comparison.highest_hz) for block in repeated], axis=0)
        shown: FloatArray = mean * sum(one.shape[0] * one.shape[1] for one in predicted)
        return shown
    angle = np.sqrt(np.max([block.motion.angle_noise for block in problem.blocks], axis=0))
    noisy = _noisier(piece.record, "motor_position", angle, generator)
    left = [
        own - one
        for own, one in zip(comparison.torque(prescribe_record(robot, noisy)), predicted, strict=True)
    ]
    alone = _noisier(piece.record, "motor_torque", robot.drives.torque_noise, generator)
    recorded = comparison.torque(piece.record)
    left += [own - one for own, one in zip(comparison.torque(alone), recorded, strict=True)]
    squares: FloatArray = np.sum([(one**2).sum(axis=(0, 1)) for one in left], axis=0)
    return squares


def _share(block: PeriodicBlock, robot: Robot, size: FloatArray, highest_hz: float) -> FloatArray:
    """Mean square of the noise of a period below a low-pass, (n_axis,)."""
    motion = block.motion
    passed = 1 / (1 + (motion.frequency_hz[1:, None] / highest_hz) ** (2 * ORDER)) ** 2
    variance = np.einsum("faa->fa", block.measured_noise(robot, size)).real[1:, : robot.n_axis]
    of_each = motion.torque_deviation.shape[2]  # periods, not their mean
    mean_square: FloatArray = 2 * of_each * (passed * variance).sum(axis=0)
    return mean_square


def _noisier(record: Record, name: str, deviation: FloatArray, generator: np.random.Generator) -> Record:
    """Return a record with white noise added to a channel."""
    runs = []
    for run in record.runs:
        channel = run.channel(name)
        values = channel.values + deviation * generator.standard_normal(channel.values.shape)
        runs.append(run.replace(channels={**run.channels, name: channel.replace(values=values)}))
    return record.replace(runs=tuple(runs))
