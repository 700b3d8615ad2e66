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
from robid_core.estimation.rigid.regression import smooth

FEWEST = 5  # samples that stay, at least
STAYS = 6.0  # standard deviations of the noise within which all of them lie
BESIDE = 10  # samples on either side, of which the acceleration is taken
FARTHER = 5.0  # times as far as it stays a motor would have gone at that acceleration: it was held
CERTAIN = 3.0  # standard errors by which an acceleration is taken smaller
HELD = 5  # of the stays, at least
SHARE = 0.5  # of them, likewise: abrupt friction held 0.6 and more, others 0.3 or less on 99 of 100 axes
TURN = 1  # samples beside a turn that do not count with it
NOISE_FROM = 0.25  # of the sampling rate: angles have noise alone above
MEDIAN = 0.455  # of a chi square with one degree of freedom
LEFT = 0.2  # of a misfit, at most, without the turns of axes that are held there
OVERLAP = 100  # samples of a motion that repeats, beyond its ends


def sticks_of(
    angles: Sequence[FloatArray], *, repeat: bool = False, sticking: BoolArray | None = None
) -> list[BoolArray]:
    """Return at which samples each axis sticks for a moment, (n_sample, n_axis) of each experiment.

    Where an angle stays within its noise for five samples or more, half its acceleration before and after, the smaller
    of both, times the square of half that time says how far the motor would have gone: several times farther, and it
    was held. An axis that was held in half of such moments has friction that turns abruptly: all of them are sticks
    then, and samples beside each turn. Otherwise none are.

    Parameters
    ----------
    angles
        Measured angles at even steps, (n_sample, n_axis) of each experiment, any unit.
    repeat
        Whether each is one period of a motion that repeats.
    sticking
        Axes that are held where they turn back even if their angles do not show it, (n_axis,); None: none.

    Examples
    --------
    A motor that stands still for 20 ms before it turns back, and one that turns back at once.

    >>> away = np.abs(0.001 * np.arange(2000) % 0.4 - 0.2)
    >>> held, turned = 20.0 * np.maximum(away - 0.01, 0.0) ** 2, 20.0 * away**2
    >>> noise = 1e-5 * np.random.default_rng(1).normal(size=(2000, 2))
    >>> (sticks,) = sticks_of([np.stack((held, turned), axis=1) + noise])
    >>> (sticks.sum(axis=0) / 5).tolist()
    [25.4, 0.0]
    """
    found = [np.zeros(angle.shape, dtype=np.bool_) for angle in angles]
    long = [i for i, angle in enumerate(angles) if len(angle) > 3 * BESIDE]
    if not long:
        return found
    before = min(OVERLAP, *(len(angles[i]) for i in long)) if repeat else 0
    lanes = [np.pad(angles[i], ((before, before), (0, 0)), mode="wrap") for i in long]
    quiet = [smooth(lane, 1.0, NOISE_FROM) for lane in lanes]
    for axis in range(angles[0].shape[1]):
        of_axis = [_stays(lane[:, axis], own[:, axis]) for lane, own in zip(lanes, quiet, strict=True)]
        shown = np.concatenate([own for _, own in of_axis])
        if not (sticking is not None and sticking[axis]) and shown.sum() < max(HELD, SHARE * len(shown)):
            continue
        for i, own, (stays, _) in zip(long, quiet, of_axis, strict=True):
            sticks = _turns(own[:, axis])
            for first, stop in stays:
                sticks[first:stop] = True
            found[i][:, axis] = sticks[before : len(sticks) - before]
    return found


def explains_most(without: float, counted: float) -> bool:
    """Whether samples at which axes turn back make most of a misfit: without them next to nothing is left.

    Of axes that are held although their angles are too coarse to show it.

    >>> explains_most(1.2, 74.0), explains_most(1.2, 3.0)
    (True, False)
    """
    return without <= LEFT * counted


def _stays(angle: FloatArray, quiet: FloatArray) -> tuple[IntArray, BoolArray]:
    """Where an angle stays within its noise, first samples and those after the last, (n_stay, 2); whether it was held.

    What a low-pass leaves of it is `quiet`, (n_sample,) both.
    """
    noise = np.sqrt(np.median((angle - quiet) ** 2) / MEDIAN / (1 - 2 * NOISE_FROM))
    reach = STAYS * noise
    within = np.ptp(np.lib.stride_tricks.sliding_window_view(angle, FEWEST), axis=1) < reach
    edge = np.flatnonzero(np.diff(within, prepend=False, append=False))
    first, stop = edge[::2], edge[1::2] + FEWEST - 1
    inside = (first >= BESIDE) & (stop + BESIDE <= len(angle))
    first, stop = first[inside], stop[inside]
    # Of a parabola through the samples, by least squares: its acceleration, and what noise does to it.
    parabola = 2 * np.linalg.pinv(np.vander(np.arange(BESIDE, dtype=np.float64), 3))[0]
    beside = np.arange(BESIDE)
    before, after = (np.abs(angle[start[:, None] + beside] @ parabola) for start in (first - BESIDE, stop))
    sure = np.minimum(before, after) - CERTAIN * noise * np.linalg.norm(parabola)
    gone = 0.5 * np.maximum(sure, 0.0) * ((stop - first) / 2) ** 2
    return np.stack((first, stop), axis=1), gone > FARTHER * reach


def _turns(quiet: FloatArray) -> BoolArray:
    """Whether a motor turns back at samples, or beside them, (n_sample,)."""
    backward = np.diff(quiet) < 0
    turns, found = np.flatnonzero(backward[1:] != backward[:-1]) + 1, np.zeros(len(quiet), dtype=np.bool_)
    for beside in range(-TURN, TURN + 1):
        found[np.clip(turns + beside, 0, len(quiet) - 1)] = True
    return found
