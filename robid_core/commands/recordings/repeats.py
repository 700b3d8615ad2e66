"""Whether a recording repeats as the answer to a periodic excitation does, and after how many samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.commands.recordings.guesses import Guess, Guesses
from robid_core.estimation.repetition import last_change, steady_repetition


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


def repeats_of(guesses: Guesses, columns: Mapping[str, FloatArray]) -> Repeats | None:
    """Return the period of what may be positions, and torques where there are any; None where it does not repeat.

    Nor where the clock is uneven: samples after whole periods are then not those of one instant.
    """
    clock = guesses.clock
    if clock is not None and (not clock.even or clock.n_gap or clock.n_back):
        return None
    position = _samples(guesses.chosen, columns, "position")
    if position is None:
        return None
    torque = _samples(guesses.chosen, columns, "torque", "current")
    found = steady_repetition(position, torque)
    if found is None:
        return None
    return Repeats(found.lag, len(position) // found.lag, last_change(position, found.lag))


def _samples(chosen: list[Guess], columns: Mapping[str, FloatArray], *quantities: str) -> FloatArray | None:
    """Return what was measured of a quantity, (n_sample, n_axis); None where there is none."""
    for guess in chosen:
        if guess.quantity in quantities and not guess.reference:
            return np.column_stack([np.asarray(columns[name], dtype=float) for name in guess.columns])
    return None
