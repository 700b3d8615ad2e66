"""Recorded lanes cut into windows that a simulation starts anew from the measured state: multi-step prediction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.robot.recorded_lanes import RecordedLanes


def window_starts(n_sample: int, n_horizon: int) -> list[int]:
    """First samples of windows that cover a recording; the last one ends with it, and may begin within the one before.

    Raises ConfigurationError where a window would have less than three samples, which tell no motion.
    """
    if n_horizon < 3:
        raise ConfigurationError("horizon_s is less than three samples; make it longer")
    if n_horizon >= n_sample:
        return [0]
    starts = list(range(0, n_sample - n_horizon, n_horizon))
    return [*starts, n_sample - n_horizon]


def cut_into_windows(lanes: RecordedLanes, starts: list[int], n_horizon: int) -> RecordedLanes:
    """Lanes of the windows of every lane, one after another, (n_lane n_window, n_horizon, n_axis)."""

    def cut(values: FloatArray) -> FloatArray:
        windows = np.stack([values[:, first : first + n_horizon] for first in starts], axis=1)
        return windows.reshape(-1, windows.shape[2], windows.shape[3])

    return lanes.through(cut)


def join_windows(values: FloatArray, starts: list[int], n_sample: int) -> FloatArray:
    """Put what was simulated in windows together, (n_lane, n_sample, n_axis): of two that overlap the later one."""
    n_window, n_axis = len(starts), values.shape[2]
    windows = values.reshape(-1, n_window, values.shape[1], n_axis)
    whole = np.empty((len(windows), n_sample, n_axis))
    for k, first in enumerate(starts):
        whole[:, first : first + windows.shape[2]] = windows[:, k]
    return whole
