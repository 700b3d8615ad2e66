"""Plateaus of a recorded motion: stretches over which a motor keeps its speed, found in what was measured alone.

A stretch is even where all speeds of a short window lie within a tolerance of their middle; even windows side by side
are one stretch, which is parted where its speed drifts. No reference is asked for: recordings of others have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import FloatArray
from robid_core.estimation.excitation.velocity_sweep import Plateau, whole_turns


@dataclass(frozen=True)
class Evenness:
    """What counts as a plateau: `tolerance` is a share of the speed; times in s."""

    tolerance: float
    shortest_s: float
    settle_s: float
    """Cut off at both ends."""


def even_windows(speed: FloatArray, tolerance: float, slowest: float, n_window: int) -> list[tuple[int, int]]:
    """Stretches of samples that are covered by even windows, (first, last + 1) each.

    Parameters
    ----------
    speed
        rad/s, shape (n_sample,).
    tolerance
        Half the spread within a window, as a share of its middle speed.
    slowest
        Windows whose middle speed is below are none, rad/s.
    n_window
        Samples of a window.
    """
    n_start = len(speed) - n_window + 1
    if n_start < 1:
        return []
    half = n_window // 2
    high = scipy.ndimage.maximum_filter1d(speed, n_window)[half : half + n_start]
    low = scipy.ndimage.minimum_filter1d(speed, n_window)[half : half + n_start]
    middle = 0.5 * (high + low)
    even = (high - low <= 2 * tolerance * np.abs(middle)) & (np.abs(middle) >= slowest)
    covered = np.zeros(len(speed) + 2, dtype=np.int64)
    np.add.at(covered, np.flatnonzero(even) + 1, 1)
    np.add.at(covered, np.flatnonzero(even) + 1 + n_window, -1)
    inside = np.cumsum(covered) > 0
    edges = np.flatnonzero(np.diff(inside.astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def parted(speed: FloatArray, first: int, last: int, tolerance: float) -> list[tuple[int, int]]:
    """Parts of a stretch within each of which the speed stays within the tolerance, one after another."""
    found, start = [], first
    low = high = float(speed[first])
    for i, value in enumerate(speed[first:last].tolist(), first):
        below, above = min(low, value), max(high, value)
        if above - below > tolerance * abs(above + below):
            found.append((start, i))
            start, low, high = i, value, value
        else:
            low, high = below, above
    return [*found, (start, last)]


def plateaus_in(
    speed: FloatArray, sample_time_s: float, slowest: FloatArray, evenness: Evenness
) -> tuple[Plateau, ...]:
    """Samples at constant speed, in the order of axes, then of time.

    Whole motor turns where a plateau has some in its shortest time, so that what repeats with the motor angle averages
    out.

    Parameters
    ----------
    speed
        Measured and smoothed speed of the motors, rad/s, shape (n_sample, n_axis).
    sample_time_s
        Time between samples.
    slowest
        Least speed of each motor, rad/s, shape (n_axis,).
    """
    n_window = max(round(evenness.shortest_s / sample_time_s), 2)
    n_settle = round(evenness.settle_s / sample_time_s)
    found = []
    for axis, own in enumerate(speed.T):
        for stretch in even_windows(own, evenness.tolerance, float(slowest[axis]), n_window):
            for first, last in parted(own, *stretch, evenness.tolerance):
                if last - first - 2 * n_settle < n_window:
                    continue
                inner = slice(first + n_settle, last - n_settle)
                mean = float(own[inner].mean())
                begin, end = whole_turns(inner.start, inner.stop, abs(mean) * sample_time_s)
                if end - begin < n_window:
                    begin, end = inner.start, inner.stop
                found.append(Plateau(axis, begin, end, mean))
    return tuple(found)
