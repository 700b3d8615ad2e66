"""Records that cannot be diagnosed are refused: before the search, and after it torques that are not of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robid_core import ComplexArray, DataRejected, FloatArray, IntArray, Record, Robot
from robid_core.residual import TorqueBlock, misfit_table
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.trials import DOUBTFUL
from robid_diagnosis.wording import experiments_text

DEAD = 3  # values: what toggles by a count has as many
UNRELATED = 0.9  # of a torque, left by all that was tried: a law that hides in the data leaves the rest of the motion's
FEWEST = 4  # experiments, all configurations together: fewer cannot be held out


def check_related(final: Fitted) -> None:
    """Refuse torques that are not those of the recorded motion: whatever was tried leaves all of them, but the mean.

    Of the experiments that count: in others the model rattles.
    """
    parts = zip(final.problem.counted_residuals(final.point), final.problem.blocks, strict=True)
    powers = np.array(
        [
            [
                (np.abs(one[..., 1:, :]) ** 2).reshape(-1, one.shape[-1]).sum(axis=0)
                for one in (_used(block, left), _used(block, block.counted(block.measured)))
            ]
            for left, block in parts
        ]
    )
    left, measured = powers.sum(axis=0)
    table = misfit_table(final.problem, final.point)
    misfit = np.nanmedian(np.hstack((table.lines, table.other)), axis=1)
    share = np.where(misfit > DOUBTFUL, np.sqrt(left / measured), 0.0)  # an axis at rest has noise alone
    worst = int(np.argmax(share))
    if share[worst] > UNRELATED:
        raise DataRejected(
            f"the motion explains nothing of the torque of {table.axis_names[worst]}: {100 * share[worst]:.0f} % of it "
            "is left whatever is fitted; is it this axis' channel, and of the same time?"
        )


def _used(block: TorqueBlock[Any], rows: ComplexArray) -> ComplexArray:
    """Rows of the experiments that count, (..., n_bin, n_row)."""
    return rows if block.used is None else rows[block.used]


def check_records(records: Sequence[Record], training: Sequence[Record], robot: Robot) -> None:
    """Refuse in one sentence what cannot be diagnosed; `training` is what the diagnosis may look at."""
    for record in records:
        if record.axis_names != robot.axis_names:
            raise DataRejected(
                f"the record has the axes {', '.join(record.axis_names)}, the robot {robot.name} has "
                f"{', '.join(robot.axis_names)}; take the robot that was measured"
            )
    runs = [run for record in records for run in record.runs]
    for name in ("motor_position", "motor_torque"):
        if any(name not in run.channels for run in runs):
            raise DataRejected(f"the record has no {name}; a diagnosis needs angle and torque of every motor")
    n_experiment = sum(run.valid[..., 0, 0].size for record in training for run in record.runs)
    if n_experiment < FEWEST:
        raise DataRejected(
            f"{experiments_text(n_experiment)}: what is found must hold in data that were held out; measure at least "
            f"{FEWEST}, better in several configurations, or cut one long motion (blocks: 10, of `robid diagnose` "
            f"--blocks 10{'; read without periods, period_s: null' if any(run.n_period > 1 for run in runs) else ''})"
        )
    for run in runs:
        levels = _levels(run.lanes("motor_torque").reshape(1, -1, robot.n_axis))
        if (levels <= DEAD).any():
            axis = robot.axis_names[int(np.argmin(levels))]
            raise DataRejected(
                f"the torque of {axis} never changes by more than a count: the channel is dead, or the drive was off"
            )
        levels = _levels(run.lanes("motor_position"))
        if (levels <= DEAD).any():
            axis = robot.axis_names[int(np.argmin(levels))]
            raise DataRejected(
                f"the angle of {axis} does not change by more than a count in any experiment: the channel is dead, or "
                "the axis was held"
            )


def _levels(lanes: FloatArray) -> IntArray:
    """Most values that each axis takes in any of the lanes (n_lane, n_sample, n_axis), (n_axis,)."""
    count = (np.count_nonzero(np.diff(np.sort(lanes, axis=1), axis=1), axis=1) + 1).max(axis=0)
    return np.asarray(count, dtype=np.int64)
