"""What the samples of a column say: whether it is a clock, whose derivative it is, which of two leads the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray

LOOKED_AT = 20_000  # samples, of a long recording
GAP = 1.5  # of the usual step: a longer one is a gap
JITTER = 0.01  # likewise: less is what rounding to microseconds does to stamps
EVEN = 0.1  # share of the usual step by which the steps of an even clock may differ; as `acquisition.recorded` takes it
OF_CLOCK = 0.5  # scatter of the steps over their mean, below which a rising column may be a clock
ALIKE = 0.98  # correlation of a column with a derivative
LAGGING = 0.5  # correlation of a difference with the speed, from which on one column lags behind the other
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e8, "s"))  # seconds since 1970 and their parts


@dataclass(frozen=True)
class Clock:
    """The steps of a column of instants, in seconds; `unit` is empty where it only counts samples."""

    name: str
    unit: str
    step_s: float
    least_s: float
    greatest_s: float
    n_gap: int
    n_back: int

    @property
    def counts(self) -> bool:
        """Whether the column counts samples and says no time."""
        return not self.unit

    @property
    def even(self) -> bool:
        """Whether no step differs by more than a tenth from the usual one."""
        return self.unevenness <= EVEN

    @property
    def unevenness(self) -> float:
        """The largest deviation of a step from the usual one, as a share of it."""
        return max(self.greatest_s - self.step_s, self.step_s - self.least_s) / self.step_s


def clock_of(name: str, values: FloatArray, unit: str = "") -> Clock | None:
    """Return the clock that a column is, None where it does not rise as one does.

    Parameters
    ----------
    name, values
        The column, (n_sample,).
    unit
        s, ms, us or ns where it is known; else it is guessed from the size of values and steps.
    """
    finite = values[np.isfinite(values)]
    if len(finite) < 3 or len(finite) < 0.9 * len(values):
        return None
    steps = np.diff(finite)
    usual = float(np.median(steps))
    n_back = int(np.count_nonzero(steps <= 0))
    if usual <= 0 or n_back > 0.01 * len(steps):
        return None
    if not unit and finite[0] < _EPOCHS[-1][0] and np.all(steps == 1.0):
        return Clock(name, "", 1.0, 1.0, 1.0, 0, 0)
    unit = unit or _guessed_unit(float(finite[0]), usual)
    factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
    gaps = int(np.count_nonzero(steps > GAP * usual))
    return Clock(
        name, unit, factor * usual, factor * float(steps.min()), factor * float(steps.max()), gaps, n_back
    )


def _guessed_unit(first: float, step: float) -> str:
    for size, unit in _EPOCHS:
        if first > size:
            return unit
    return "s" if step < 1 else "ms" if step < 500 else "us" if step < 5e5 else "ns"


def rises_evenly(values: FloatArray) -> bool:
    """Tell whether a column of no telling name rises as a clock does."""
    if not np.isfinite(values).all() or len(values) < 20:
        return False
    steps = np.diff(values)
    return bool(steps.min() > 0 and np.std(steps) < OF_CLOCK * np.mean(steps))


def derivative_factor(values: FloatArray, other: FloatArray, time_s: FloatArray | None) -> float:
    """Return k where `other` is k times the derivative of `values`; 0 where it is none.

    Both are smoothed alike by a moving mean, as differences of samples are rough. Without instants k is per sample.

    Parameters
    ----------
    values, other
        (n_sample,) each.
    time_s
        Instants, (n_sample,), or None.
    """
    values, other = values[:LOOKED_AT], other[:LOOKED_AT]
    step = np.ones(len(values)) if time_s is None else np.gradient(time_s[:LOOKED_AT])
    if (
        len(values) < 50
        or not np.isfinite([values, other, step]).all()
        or np.ptp(other) == 0
        or step.min() <= 0
    ):
        return 0.0
    kernel = np.ones(max(5, len(values) // 500)) / max(5, len(values) // 500)
    slope = np.convolve(np.gradient(values) / step, kernel, "valid")
    smooth = np.convolve(other, kernel, "valid")
    if np.std(slope) == 0 or abs(np.corrcoef(slope, smooth)[0, 1]) < ALIKE:
        return 0.0
    return float(slope @ smooth / (slope @ slope))


def follow_each_other(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether two columns are as alike as a reference and what follows it."""
    one, other = one[:LOOKED_AT], other[:LOOKED_AT]
    if (
        not np.isfinite([one, other]).all()
        or np.ptp(one) == 0
        or np.ptp(other) == 0
        or np.array_equal(one, other)
    ):
        return False
    spread = np.std(one)
    return bool(np.sqrt(np.mean((one - other - np.mean(one - other)) ** 2)) < 0.1 * spread)


def leads(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether `other` is ahead of `one`, as a reference is of what follows it.

    To first order ``other(t) = one(t + tau)``, so that their difference is tau times the speed.
    """
    speed = np.gradient(one[:LOOKED_AT])
    difference = (other - one)[:LOOKED_AT]
    if np.std(speed) == 0 or np.std(difference) == 0:
        return False
    return bool(np.corrcoef(difference, speed)[0, 1] > LAGGING)
