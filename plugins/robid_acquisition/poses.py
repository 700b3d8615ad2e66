"""Where the robot stood in each experiment, and whether the experiments of a configuration stood alike."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_acquisition.arrangement import Arrangement, listed
from robid_core import FloatArray, Robot


def mean_angle(values: Mapping[str, FloatArray], robot: Robot) -> FloatArray:
    """Mean motor angle seen through the gear, shape (n_axis,); the joint's own where no motor angle was recorded.

    `values` holds the channels of one experiment, each (n_period, n_sample, n_axis).
    """
    for name in ("motor_position", "joint_position"):
        if name in values:
            known: FloatArray = np.nan_to_num(_mean(values[name]))
            return robot.joint_angle(known) if name == "motor_position" else known
    return np.zeros(robot.n_axis)


def reach_about_mean(values: Mapping[str, FloatArray], robot: Robot) -> float:
    """How far an experiment goes from its mean angle, at the joint that goes farthest; channels as of `mean_angle`."""
    for name in ("motor_position", "joint_position"):
        if name in values:
            angle = robot.joint_angle(values[name]) if name == "motor_position" else values[name]
            away = np.abs(angle - mean_angle(values, robot))
            return float(np.where(np.isfinite(away), away, 0.0).max())
    return 0.0


def _mean(values: FloatArray) -> FloatArray:
    """Mean over the samples that are known, NaN where none is."""
    known = np.isfinite(values)
    count = known.sum(axis=(0, 1))
    total = np.where(known, values, 0.0).sum(axis=(0, 1))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def unlike_poses(
    arrangement: Arrangement, angle: FloatArray, tolerance: float, axis_names: tuple[str, ...]
) -> str:
    """Say which configurations hold experiments in different poses, empty where none does.

    Parameters
    ----------
    arrangement
        The experiments.
    angle
        Mean angle of each, shape (n_config, n_block, n_exp, n_axis).
    tolerance
        Distance from the configuration's mean, rad or m, that is still alike.
    axis_names
        For the message.
    """
    away = np.abs(angle - angle.mean(axis=(1, 2), keepdims=True))
    far = np.flatnonzero((away > tolerance).any(axis=(1, 2, 3)))
    if not len(far):
        return ""
    c, b, e, a = (int(i) for i in np.unravel_index(int(away.argmax()), away.shape))
    numbers = listed([arrangement.recordings[i][0][0].configuration for i in far])
    worst = f"{arrangement.recordings[c][b][e].name} with {away.max():.3g} at {axis_names[a]}"
    return (
        f"{len(far)} of {len(away)} configurations hold poses that differ by more than {tolerance:g} from their mean "
        f"(number {numbers}), most of all {worst}; estimators take them for one pose: give other poses another number"
    )
