"""How far the axes of records went: what a fit saw, and what a prediction is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.artifacts import DenseRun, ExcitedRange, Record
from robid_core.estimation.sample_marks import sample_marks

HIGHEST_HZ = 20.0  # of what counts as motion: accelerations above are those of noise and of arms that ring
ORDER = 4
RARE = 1e-3  # share of the samples that may be beyond: single ones are knocks


def excited_range(records: Sequence[Record]) -> ExcitedRange | None:
    """Return how far the axes went in all records together, motor side.

    Angles are smoothed up to 20 Hz, forwards and backwards, and differentiated by central differences. Of every
    quantity that is taken which one sample in a thousand exceeds. None where angles of motors were not recorded.
    """
    if any("motor_position" not in run.channels for one in records for run in one.runs):
        return None
    parts = [each for one in records for run in one.runs for each in _quantities(run)]
    position, speed, acceleration, torque = (np.concatenate(values) for values in zip(*parts, strict=True))
    low, high = np.quantile(position, [RARE, 1 - RARE], axis=0)
    sizes = (np.quantile(np.abs(values), 1 - RARE, axis=0) for values in (speed, acceleration, torque))
    reach = ExcitedRange(records[0].axis_names, low, high, *sizes)
    return reach.replace(marks=sample_marks(records))


def _quantities(run: DenseRun) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Position, speed, acceleration and torque of each experiment, (n_sample, n_axis), its ends cut off."""
    highest = min(HIGHEST_HZ, 0.2 / run.sample_time_s)
    low_pass = scipy.signal.butter(ORDER, highest, fs=1 / run.sample_time_s, output="sos")
    cut = min(round(1 / (highest * run.sample_time_s)), run.n_period * len(run.time_s) // 10)
    position = run.lanes("motor_position")
    torque = run.lanes("motor_torque") if "motor_torque" in run.channels else np.full_like(position, np.nan)
    for angle, acting in zip(position, torque, strict=True):
        kept = np.isfinite(angle).all(axis=1)
        smooth = scipy.signal.sosfiltfilt(low_pass, angle[kept], axis=0)
        speed = np.gradient(smooth, run.sample_time_s, axis=0)
        acceleration = np.gradient(speed, run.sample_time_s, axis=0)
        inside = slice(cut, len(smooth) - cut)
        known = np.isfinite(acting).all()
        shown = scipy.signal.sosfiltfilt(low_pass, acting[kept], axis=0) if known else acting[kept]
        yield smooth[inside], speed[inside], acceleration[inside], shown[inside]
