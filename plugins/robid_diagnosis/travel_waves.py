"""Waves over the travel of an axis: which wavelengths the torque that a model leaves has.

A motor that turns gives low whole orders a turn to try; of a slide nobody told the pitch of its screw, and cogging has
as many periods a turn as the least common multiple of slots and poles, often sixty or more. The spectrum of what is
left, over the position instead of time, is looked through for peaks: of torques that stand in space (ripple, cogging)
and of those that turn round with the motion (friction). Its bins are independent waves, so many more trials of a
search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray

HIGHEST = 1e4  # the bound of every effect's order
FINER = 4  # steps of the order in an independent bin
MOST = 4  # peaks of either kind
BACK = 0.2  # of the way: an axis that goes back by less shows a frequency as well as a wave
CELLS = 16  # of position in the shortest wave: samples of a cell count as one


@dataclass(frozen=True)
class Waves:
    """Periodic components of a residual torque over the travel: their orders, and how many were searched."""

    peaks: tuple[float, ...]
    """Orders worth a try, ascending, in periods of 2 pi m of a slide, or a turn; never zero."""
    n_independent: int
    """Waves that were looked through."""


def waves_of(
    left: FloatArray, position: FloatArray, speed: FloatArray, highest_hz: float, lowest: float = 0.0
) -> Waves:
    """Look for the waves of a torque over the travel.

    Parameters
    ----------
    left
        Torque that a model leaves, N or N m, (n_sample,).
    position, speed
        m and m/s, or rad and rad/s, (n_sample,).
    highest_hz
        Of the torque: waves that are passed faster at the rms speed are not in it.
    lowest
        Orders up to this one are not looked for.
    """
    travel, rms = float(np.ptp(position)), float(np.sqrt((speed**2).mean()))
    if travel == 0 or rms == 0:
        return Waves((), 0)
    highest = min(HIGHEST, 2 * np.pi * highest_hz / rms)
    if highest <= lowest:
        return Waves((), 0)
    whole, spacing = _powers(np.stack((left, left * np.sign(speed))), position, highest)
    first = max(FINER, int(lowest / spacing) + 1)
    power = whole[:, first:]
    orders = spacing * (first + np.arange(power.shape[1]))
    peaks = {float(orders[i]) for own in power for i in _highest(own)}
    return Waves(tuple(sorted(peaks)), 2 * len(orders) // FINER)


def goes_one_way(speed: FloatArray) -> bool:
    """Whether an axis goes back by so little that a vibration in time looks like a wave over its travel.

    At one speed the two are the same, and a slow move has enough waves for one to be near any frequency.
    """
    back, whole = float(np.maximum(-speed, 0.0).sum()), float(np.abs(speed).sum())
    return not BACK * whole <= back <= (1 - BACK) * whole


def _powers(kinds: FloatArray, position: FloatArray, highest: float) -> tuple[FloatArray, float]:
    """Squared size of the waves of all orders from zero on, (n_kind, n_order), and how far these are apart."""
    travel = float(np.ptp(position))
    step = 2 * np.pi / highest / CELLS
    cell = ((position - position.min()) / step).astype(np.int64)
    length = int(np.ceil(FINER * travel / step))
    sums = np.stack([np.bincount(cell, own, minlength=length) for own in kinds])
    power: FloatArray = np.abs(np.fft.rfft(sums, axis=1)) ** 2
    spacing = 2 * np.pi / (length * step)
    return power[:, : int(highest / spacing)], spacing


def _highest(power: FloatArray) -> list[int]:
    """Numbers of the highest peaks, each the largest within an independent bin to either side."""
    reach = np.lib.stride_tricks.sliding_window_view(np.pad(power, FINER), 2 * FINER + 1)
    peaks = np.flatnonzero(power >= reach.max(axis=1))
    found: list[int] = peaks[np.argsort(-power[peaks])][:MOST].tolist()
    return found
