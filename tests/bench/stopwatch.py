"""Ratios that mean something on a shared machine: contestants take turns in one process, medians over rounds."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Contestant:
    """Something to time."""

    run: Callable[[], object]
    work: float
    """What one call gets done, such as simulated seconds."""


class Race:
    """Rates of contestants that took turns, work per second; the first round (compilation, caches) does not count.

    The clock is this process' time on a processor: who else computes on the machine does not count, but for the
    caches he shares. With `wall`, it is the clock on the wall, for what runs on more than one core.
    """

    def __init__(self, contestants: dict[str, Contestant], n_round: int, *, wall: bool = False) -> None:
        clock = time.perf_counter if wall else time.process_time
        self.rates: dict[str, FloatArray] = {name: np.zeros(n_round) for name in contestants}
        for contestant in contestants.values():
            contestant.run()
        collecting = gc.isenabled()
        gc.disable()
        try:
            for turn in range(n_round):
                for name, contestant in contestants.items():
                    start = clock()
                    contestant.run()
                    self.rates[name][turn] = contestant.work / (clock() - start)
        finally:
            if collecting:
                gc.enable()

    def rate(self, name: str) -> float:
        """Median rate."""
        return float(np.median(self.rates[name]))

    def spread(self, name: str) -> str:
        """Return slowest and fastest round, in words."""
        return f"{self.rates[name].min():.3g} to {self.rates[name].max():.3g}"

    def ratio(self, faster: str, slower: str) -> float:
        """Median over rounds of the ratio of two rates that were measured one after the other."""
        return float(np.median(self.rates[faster] / self.rates[slower]))
