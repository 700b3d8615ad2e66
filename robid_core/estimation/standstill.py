"""Samples at which an axis stands still: friction may have any value up to its level there.

What friction is while an axis sticks, no function of its speed says. A fit leaves such samples out, or says how many
there are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from robid_core.arrays import BoolArray, FloatArray
from robid_core.estimation.noise_above import density_above
from robid_core.estimation.rigid.regression import differentiate, smooth
from robid_core.estimation.sticks import sticking_axes, sticks_of

STICK_S, STICK = 0.02, 5  # an angle that stays for that long, and so many samples, may stick
RANGE = 4.0  # standard deviations of its noise within which it stays then
ABRUPT = 6.0  # likewise, that a low-pass takes off a motion where friction stops a motor at once
LOST = 0.2  # of the rms acceleration: likewise
SPAN_S = 0.1  # an axis that turns back is slow for less
NOISE = 2.0  # standard deviations of the speed's noise
OF_MOTION_HZ = 20.0  # motion below it, where nobody says another edge
SHORTEST = 50  # samples: fewer are at rest nowhere
SLOWEST, SLOW = 1e-3, 2e-2  # of the rms speed of an axis: what counts as rest at least, and at most


def rests_of(
    angles: Sequence[FloatArray], sample_times: Sequence[float], sticking: BoolArray | None = None
) -> list[BoolArray]:
    """Return at which samples each axis stands still or sticks, (n_sample, n_axis) of each experiment.

    They are those of `at_rest`, and moments at which it sticks before it turns back (`sticks_of`).

    Parameters
    ----------
    angles, sample_times
        Measured angles of the motors, (n_sample, n_axis) each, without holes, and s.
    sticking
        Whether each axis sticks, (n_axis,); None: as the angles show.
    """
    edge = min([OF_MOTION_HZ, *(0.2 / step for step in sample_times)])
    found = sticks_of(angles, sticking_axes(angles) if sticking is None else sticking)
    long = [i for i, angle in enumerate(angles) if len(angle) >= SHORTEST]
    smoothed = [smooth(angles[i], sample_times[i], edge) for i in long]
    speeds = [differentiate(one, sample_times[i]) for i, one in zip(long, smoothed, strict=True)]
    if long:
        still = at_rest([angles[i] for i in long], speeds, smoothed, [sample_times[i] for i in long], edge)
        for i, own in zip(long, still, strict=True):
            found[i] |= own
    return found


def at_rest(
    angles: Sequence[FloatArray],
    speeds: Sequence[FloatArray],
    smoothed: Sequence[FloatArray],
    sample_times: Sequence[float],
    cutoff_hz: float,
) -> list[BoolArray]:
    """Return at which samples each axis stands still, (n_sample, n_axis) of each experiment.

    An axis stands still where its speed over a tenth of a second is no more than what noise of the angle makes of it.
    The noise is what a low-pass took off the angle; where it is large, an axis is at rest below a fiftieth of its rms
    speed only. An axis that does not move in any experiment is at rest nowhere.

    Parameters
    ----------
    angles, speeds, smoothed
        Measured, derived and smoothed angles of the experiments, (n_sample, n_axis) each.
    sample_times
        Of each experiment, s.
    cutoff_hz
        Edge of that low-pass.
    """
    rms, found = _rms(speeds), []
    for angle, speed, quiet, sample_time in zip(angles, speeds, smoothed, sample_times, strict=True):
        noise = _noise_of_speed(angle - quiet, sample_time, cutoff_hz)
        slow = np.clip(NOISE * noise, SLOWEST * rms, SLOW * rms)
        n_span = 2 * max(round(SPAN_S / sample_time / 2), 1) + 1
        mean = scipy.ndimage.uniform_filter1d(speed**2, n_span, axis=0, mode="nearest")
        still = mean < slow**2
        found.append(scipy.ndimage.maximum_filter1d(still, n_span, axis=0))
    return found


def may_stick(
    angles: Sequence[FloatArray],
    speeds: Sequence[FloatArray],
    smoothed: Sequence[FloatArray],
    sample_times: Sequence[float],
    cutoff_hz: float,
) -> list[BoolArray]:
    """Return at which samples an axis may stick, for however short, (n_sample, n_axis) of each experiment.

    A motor that turns back sticks until the torque has passed from one friction level to the other. That is found in
    the measured angle, since a low-pass makes of a stick of some hundredths of a second a slow motion: the angle stays
    within its noise for `STICK_S`. So it does for a moment where a motor turns back slowly without a stick: then what
    is left out tells of the speed within which friction turns only. A motor that friction stops at once is at rest or
    turns back within less than the low-pass tells: there more than noise is taken off the angle, as much as the speed
    that is left amounts to within the cutoff's period, and the instant at which friction changed is not known.
    Arguments are those of `at_rest`.
    """
    acceleration = [differentiate(speed, step) for speed, step in zip(speeds, sample_times, strict=True)]
    lost = LOST * _rms(acceleration) / (2 * np.pi * cutoff_hz) ** 2
    rms, found = _rms(speeds), []
    for angle, speed, quiet, sample_time in zip(angles, speeds, smoothed, sample_times, strict=True):
        nyquist = 0.5 / sample_time
        noise = np.sqrt(density_above(angle - quiet, sample_time, cutoff_hz) * nyquist)
        n_span = max(2 * round(STICK_S / sample_time / 2) + 1, STICK)
        span = (n_span - 1) * sample_time
        reach = np.clip(RANGE * noise, SLOWEST * rms * span, SLOW * rms * span)
        passed = scipy.ndimage.maximum_filter1d(angle, n_span, axis=0)
        passed -= scipy.ndimage.minimum_filter1d(angle, n_span, axis=0)
        stays = scipy.ndimage.maximum_filter1d(passed < reach, n_span, axis=0)
        off = np.abs(angle - quiet)
        off[off < np.maximum(ABRUPT * noise, lost)] = 0.0
        off = scipy.ndimage.maximum_filter1d(off, max(round(1 / (cutoff_hz * sample_time)), 1), axis=0)
        found.append(stays | (np.abs(speed) < 2 * np.pi * cutoff_hz * off))
    return found


def _rms(values: Sequence[FloatArray]) -> FloatArray:
    """Over all samples of all experiments, (n_axis,)."""
    result: FloatArray = np.sqrt(sum((one**2).sum(axis=0) for one in values) / sum(map(len, values)))
    return result


def _noise_of_speed(above: FloatArray, sample_time: float, cutoff_hz: float) -> FloatArray:
    """Rms of the speed below an edge, (n_axis,), by white noise of which all `above` that edge is known."""
    density = density_above(above, sample_time, cutoff_hz)
    result: FloatArray = 2 * np.pi * np.sqrt(density * cutoff_hz**3 / 3)
    return result
