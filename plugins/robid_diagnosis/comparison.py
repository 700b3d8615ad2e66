"""Torques and speeds that models give against those of a record, over time, axis by axis, with intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import BoolArray, DataRejected, DenseRun, FloatArray, PredictionErrors, Record, Robot
from robid_diagnosis.intervals import intervals, relative_errors, sums_of_blocks

STILL = 1e-3  # of travel at the joint, rad or m: an axis that goes less hardly moves
ORDER = 4  # of the low-pass, forwards and backwards
REFERENCES = ("position_reference", "speed_reference")
TOLD, REFITTED, EXTENDED = "robot file", "robot file, values refitted", "extended robot"

Signals = Sequence[FloatArray]
"""Of each run of a record, filtered, its ends cut off, (n_lane, n_sample, n_axis)."""


@dataclass(frozen=True)
class Comparison:
    """Settings of a comparison of measured and predicted signals: band, ends, blocks."""

    stage: str
    """Who asks, in messages."""
    highest_hz: float = 100.0
    """Errors above are left out."""
    skip_s: float = 0.5
    """At both ends of each experiment."""
    block_s: float = 1.0
    """Length of the blocks that are drawn for intervals."""

    def torque(self, record: Record) -> list[FloatArray]:
        """Of the motors."""
        return [self._filtered(run, run.lanes("motor_torque")) for run in record.runs]

    def speed(self, record: Record) -> list[FloatArray]:
        """Of the motors, by differences of their angles."""
        return [
            self._filtered(run, np.gradient(run.lanes("motor_position"), run.sample_time_s, axis=1))
            for run in record.runs
        ]

    def angle(self, record: Record) -> list[FloatArray]:
        """Of the motors."""
        return [self._filtered(run, run.lanes("motor_position")) for run in record.runs]

    def sums(
        self, records: Sequence[Record], measured: Signals, predicted: Mapping[str, Signals]
    ) -> tuple[dict[str, FloatArray], FloatArray, int]:
        """Sums of squares of each model's errors and of what was measured, (n_block, n_axis), and how many values.

        Parameters
        ----------
        records
            That were predicted.
        measured, predicted
            Signals of all their runs, one after another, and those of each model by its name.
        """
        runs = [run for record in records for run in record.runs]
        lengths = [max(1, round(self.block_s / run.sample_time_s)) for run in runs]

        def sums(parts: Iterable[FloatArray]) -> FloatArray:
            return np.concatenate([sums_of_blocks(x, n) for x, n in zip(parts, lengths, strict=True)])

        error = {
            name: sums(p - m for p, m in zip(parts, measured, strict=True))
            for name, parts in predicted.items()
        }
        return error, sums(measured), sum(part.shape[0] * part.shape[1] for part in measured)

    def _filtered(self, run: DenseRun, values: FloatArray) -> FloatArray:
        highest, cut = min(self.highest_hz, 0.45 / run.sample_time_s), round(self.skip_s / run.sample_time_s)
        n_sample = values.shape[1]
        if n_sample - 2 * cut < 2:
            raise DataRejected(
                f"{self.stage}: of an experiment of {n_sample * run.sample_time_s:g} s nothing is left when "
                f"skip_s = {self.skip_s:g} s is cut off at both ends; choose less"
            )
        low_pass = scipy.signal.butter(ORDER, highest, fs=1 / run.sample_time_s, output="sos")
        smooth: FloatArray = scipy.signal.sosfiltfilt(low_pass, values, axis=1)
        return smooth[:, cut : n_sample - cut]


def errors_of_models(
    quantity: str,
    unit: str,
    error: Mapping[str, FloatArray],
    power: FloatArray,
    n_value: float,
    record: Record,
    still: BoolArray,
    generator: np.random.Generator,
    noise: FloatArray | None = None,
) -> tuple[list[PredictionErrors], FloatArray]:
    """Errors of models from sums of squares, and the interval of what the last gains on the first, (2,).

    Parameters
    ----------
    quantity, unit
        In words.
    error
        Sums of squared errors of each model, by its name, over each block, (n_block, n_axis).
    power
        Likewise of what was measured.
    n_value
        Values in all blocks, of each axis.
    record
        Names the axes.
    still
        Axes that hardly moved, (n_axis,).
    generator
        Draws blocks.
    noise
        Sum of squares that a right model would leave in all blocks, (n_axis,), where it is known.
    """
    stacked = np.stack(list(error.values()))
    found = intervals(stacked, power, generator)
    relative = relative_errors(stacked.sum(axis=1), power.sum(axis=0))
    rows = [
        PredictionErrors(
            model=name,
            quantity=quantity,
            unit_symbol=unit,
            axis_names=record.axis_names,
            rms=np.sqrt(stacked[m].sum(axis=0) / n_value),
            relative=relative[m],
            low=found.relative[0, m],
            high=found.relative[1, m],
            still=still,
            noise=None if noise is None else relative_errors(noise, power.sum(axis=0)),
        )
        for m, name in enumerate(error)
    ]
    return rows, found.gain


def still_axes(robot: Robot, records: Sequence[Record]) -> BoolArray:
    """Say which axes hardly moved, shape (n_axis,)."""
    runs = [run for record in records for run in record.runs]
    travels = [np.ptp(robot.joint_angle(run.lanes("motor_position")), axis=1) for run in runs]
    still: BoolArray = np.concatenate(travels).max(axis=0) < STILL
    return still


def has_references(records: Sequence[Record]) -> bool:
    """Whether all that was measured tells what the controllers followed."""
    return all(any(name in run.channels for name in REFERENCES) for one in records for run in one.runs)
