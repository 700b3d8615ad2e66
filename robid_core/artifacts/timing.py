"""Timing of channels against one another, as the data tell it."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array


@dataclass(frozen=True, eq=False)
class Timing(Artifact):
    """By how many samples the recorded torque of each axis lags its angle (negative: leads it)."""

    axis_names: tuple[str, ...]
    sample_time_s: float
    lag: FloatArray = array("n_axis", "sample")
    standard_error: FloatArray = array("n_axis", "sample", finite=False)
