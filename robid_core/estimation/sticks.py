"""Sticks: moments at which friction that turns abruptly holds an axis where it turns back.

Friction that does not turn gradually with the speed holds a motor that turns back until the torque has passed from one
friction level to the other. What it is meanwhile, no function of the speed says. A motor that turns back without a
stick stays within the noise of its angle for a moment, too, but its acceleration goes on, where one that sticks has
none. An axis whose friction holds it wherever that can be seen is held at all turns, however short.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.estimation.noise_above import density_above
from robid_core.estimation.rigid.regression import smooth

FEWEST = 5  # samples that stay, at least
STAYS = 6.0  # standard deviations of the noise within which all of them lie
BESIDE = 10  # samples on either side, of which the acceleration is taken
FARTHER = 5.0  # times as far as it stays a motor would have gone at that acceleration: it was held
CERTAIN = 3.0  # standard errors by which an acceleration is taken smaller
MOVES = 20.0  # times as far as an angle stays: experiments in which an axis moves no farther show no turns
HELD = 5  # of the stays, at least
SHARE = 0.5  # of them, likewise: abrupt friction held 0.6 and more, others 0.3 or less on 99 of 100 axes
SLOW = 6.0  # standard deviations of its noise from sample to sample: slower, a motor may stand still
TURN = 1  # samples beside a turn that do not count with it
NOISE_FROM = 0.25  # of the sampling rate: angles have noise alone above
OVERLAP = 100  # samples of a motion that repeats, beyond its ends


def sticking_axes(angles: Sequence[FloatArray]) -> BoolArray:
    """Return whether friction that turns abruptly holds each axis where it turns back, (n_axis,).

    Where an angle stays within its noise for five samples or more, half its acceleration before and after, the smaller
    of both, times the square of half that time says how far the motor would have gone: several times farther, and it
    was held. An axis sticks that was held in half of such moments. Experiments in which it hardly moves are not asked.

    Parameters
    ----------
    angles
        Measured angles at even steps, (n_sample, n_axis) of each experiment, any unit.

    Examples
    --------
    A motor that stands still for 20 ms before it turns back, and one that turns back at once.

    >>> away = np.abs(0.001 * np.arange(2000) % 0.4 - 0.2)
    >>> held, turned = 20.0 * np.maximum(away - 0.01, 0.0) ** 2, 20.0 * away**2
    >>> noise = 1e-5 * np.random.default_rng(1).normal(size=(2000, 2))
    >>> sticking_axes([np.stack((held, turned), axis=1) + noise]).tolist()
    [True, False]
    """
    held, n_stay = np.zeros((2, angles[0].shape[1] if angles else 0))
    for angle in angles:
        if len(angle) > 3 * BESIDE:
            noise = _noise(angle, _quiet(angle))
            for axis in np.flatnonzero(np.ptp(angle, axis=0) > MOVES * STAYS * noise):
                own = angle[:, axis]
                stays = _stays(own, noise[axis])
                held[axis] += _held(own, stays, noise[axis]).sum()
                n_stay[axis] += len(stays)
    sticking: BoolArray = held >= np.maximum(HELD, SHARE * n_stay)
    return sticking


def sticks_of(angles: Sequence[FloatArray], sticking: BoolArray, *, repeat: bool = False) -> list[BoolArray]:
    """Return at which samples friction holds axes, for however short, (n_sample, n_axis) of each experiment.

    These are all at which the angle of an axis that sticks stays within its noise for five samples or more, those
    beside each turn, and those at which it is too slow for its noise to say that it moves.

    Parameters
    ----------
    angles
        Measured angles at even steps, (n_sample, n_axis) of each experiment, any unit.
    sticking
        Whether each axis sticks, (n_axis,).
    repeat
        Whether each experiment is one period of a motion that repeats.

    Examples
    --------
    A motor that stands still for 20 ms each time before it turns back.

    >>> away = np.abs(0.001 * np.arange(2000) % 0.4 - 0.2)
    >>> angle = 20.0 * np.maximum(away - 0.01, 0.0)[:, None] ** 2
    >>> angle += 1e-5 * np.random.default_rng(1).normal(size=angle.shape)
    >>> (sticks,) = sticks_of([angle], sticking_axes([angle]))
    >>> sticks.sum() / 5
    np.float64(27.4)
    """
    found = [np.zeros(angle.shape, dtype=np.bool_) for angle in angles]
    for angle, marks in zip(angles, found, strict=True):
        if len(angle) <= 3 * BESIDE or not sticking.any():
            continue
        beyond = min(OVERLAP, len(angle)) if repeat else 0
        lane = np.pad(angle, ((beyond, beyond), (0, 0)), mode="wrap")
        quiet = _quiet(lane)
        noise = _noise(lane, quiet)
        for axis in np.flatnonzero(sticking):
            sticks = _turns(quiet[:, axis], noise[axis])
            for first, stop in _stays(lane[:, axis], noise[axis]):
                sticks[first:stop] = True
            marks[:, axis] = sticks[beyond : len(sticks) - beyond]
    return found


def _quiet(angle: FloatArray) -> FloatArray:
    """Angles without what lies above all motion, their shape."""
    return smooth(angle, 1.0, NOISE_FROM)


def _noise(angle: FloatArray, quiet: FloatArray) -> FloatArray:
    """Standard deviation of white noise of which that is left above, (n_axis,)."""
    noise: FloatArray = np.sqrt(0.5 * density_above(angle - quiet, 1.0, NOISE_FROM))
    return noise


def _stays(angle: FloatArray, noise: float) -> IntArray:
    """Where an angle, (n_sample,), stays within its noise: first samples and those after the last, (n_stay, 2)."""
    within = np.ptp(np.lib.stride_tricks.sliding_window_view(angle, FEWEST), axis=1) < STAYS * noise
    edge = np.flatnonzero(np.diff(within, prepend=False, append=False))
    stays: IntArray = np.stack((edge[::2], edge[1::2] + FEWEST - 1), axis=1)
    return stays


def _held(angle: FloatArray, stays: IntArray, noise: float) -> BoolArray:
    """Whether a motor would have gone farther at its acceleration before and after it stayed, (n_stay,)."""
    first, stop = stays.T
    inside = (first >= BESIDE) & (stop + BESIDE <= len(angle))
    first, stop = first[inside], stop[inside]
    # Of a parabola through the samples, by least squares: its acceleration, and what noise does to it.
    parabola = 2 * np.linalg.pinv(np.vander(np.arange(BESIDE, dtype=np.float64), 3))[0]
    beside = np.arange(BESIDE)
    before, after = (np.abs(angle[start[:, None] + beside] @ parabola) for start in (first - BESIDE, stop))
    sure = np.minimum(before, after) - CERTAIN * noise * np.linalg.norm(parabola)
    gone = 0.5 * np.maximum(sure, 0.0) * ((stop - first) / 2) ** 2
    held = np.zeros(len(stays), dtype=np.bool_)
    held[inside] = gone > FARTHER * STAYS * noise
    return held


def _turns(quiet: FloatArray, noise: float) -> BoolArray:
    """Whether a motor turns back at samples, or beside them, or nearly stops, (n_sample,)."""
    change = np.diff(quiet)
    turns = np.flatnonzero((change[1:] < 0) != (change[:-1] < 0)) + 1
    slow, found = np.flatnonzero(np.abs(change) < SLOW * noise), np.zeros(len(quiet), dtype=np.bool_)
    for at in (*(turns + beside for beside in range(-TURN, TURN + 1)), slow, slow + 1):
        found[np.clip(at, 0, len(quiet) - 1)] = True
    return found
