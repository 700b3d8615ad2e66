"""How a recording moves: about which pose, and whether it repeats as the answer to a periodic excitation does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.commands.recordings.guesses import Guess, Guesses
from robid_core.estimation.repetition import last_change, steady_repetition

APART = 0.5  # of the rms motion of the axis that moves most: means further apart are those of other poses


@dataclass(frozen=True)
class Repeats:
    """The period of a recording."""

    lag: int
    """In samples."""
    n_period: int
    """Whole periods that were recorded."""
    change: float
    """By which the positions of the last two differ, over their rms motion."""

    def text(self, step_s: float | None) -> str:
        """Say how it repeats; `step_s` is the sampling time where it is known."""
        every = f"{self.lag} samples" if step_s is None else f"{self.lag * step_s:.6g} s ({self.lag} samples)"
        return f"repeats every {every}; {self.n_period} periods, the last two alike within {100 * self.change:.2g} %"


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions of a recording, in the unit of its file."""

    mean: FloatArray
    """(n_axis,)."""
    rms: FloatArray
    """About the mean, (n_axis,)."""
    repeats: Repeats | None
    """None where it does not repeat."""


@np.errstate(over="ignore", invalid="ignore")  # numbers near the largest of all are no positions
def motion_of(guesses: Guesses, columns: Mapping[str, FloatArray]) -> Motion | None:
    """Return what may be positions move like; None where there are none, or an axis is never known.

    Where the clock is uneven nothing repeats: samples after whole periods are not those of one instant.
    """
    position = _samples(guesses.chosen, columns, "position")
    if position is None or not np.isfinite(position).any(axis=0).all():
        return None
    mean, rms = np.nanmean(position, axis=0), np.nanstd(position, axis=0)
    if not (np.isfinite(mean).all() and np.isfinite(rms).all()):
        return None
    return Motion(mean, rms, _repeats(guesses, columns, position))


def poses_differ(motions: Sequence[Motion]) -> bool:
    """Whether recordings of one robot were made in different poses, as far as their motions tell."""
    if len({len(one.mean) for one in motions}) != 1:
        return False
    means, rms = np.stack([one.mean for one in motions]), max(float(one.rms.max()) for one in motions)
    return bool((np.ptp(means, axis=0) > APART * rms).any())


def _repeats(guesses: Guesses, columns: Mapping[str, FloatArray], position: FloatArray) -> Repeats | None:
    clock = guesses.clock
    if clock is not None and (not clock.even or clock.n_gap or clock.n_back):
        return None
    found = steady_repetition(position, _samples(guesses.chosen, columns, "torque", "current"))
    if found is None:
        return None
    return Repeats(found.lag, found.n_period, last_change(position, found.lag))


def _samples(chosen: list[Guess], columns: Mapping[str, FloatArray], *quantities: str) -> FloatArray | None:
    """Return what was measured of a quantity, (n_sample, n_axis); None where there is none."""
    for guess in chosen:
        if guess.quantity in quantities and not guess.reference:
            return np.column_stack([np.asarray(columns[name], dtype=float) for name in guess.columns])
    return None
