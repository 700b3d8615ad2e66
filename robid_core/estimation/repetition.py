"""Whether signals repeat, and after how many samples.

The difference of a signal from itself p samples later, as a share of what two unrelated pieces would differ by,

    d(p) = sum_t |x(t + p) - x(t)|^2 / sum_t (|x(t + p)|^2 + |x(t)|^2),

is 1 where nothing repeats and the noise's share where p is a period (difference function, de Cheveigne and Kawahara
2002). Signals are taken less their mean, each to unit variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.errors import DataRejected

REPEATS = 0.1  # of d: above, nothing repeats
LONGEST = 0.55  # of the recording: two periods, and what lies beside the minimum
UNRELATED = 0.5  # of d: a lag at which the signal has turned away from itself
ALIKE = 4.0  # factor on the smallest d, within which a shorter period is one as well
WHOLE = 0.2  # samples over the whole recording, by which a period may miss a whole number, beside its error
SIGMAS = 4.0  # of that error
BOTTOM = 0.15  # of d above its minimum, at most: how far its course is taken for a parabola
ROUNDING = 1e-9  # of d
FEWEST = 20  # samples: below, nothing is said of a period
FAITHFUL = (
    0.5  # of what moves within a sample, rms: periods that differ by less begin at one instant of a clock
)


@dataclass(frozen=True)
class Repetition:
    """The shortest period of signals."""

    lag: int
    """In samples, to the nearest whole one."""
    difference: float
    """d of it."""
    exact: float
    """In samples, from the longest multiple of it that is seen."""
    error: float
    """Standard error of `exact`, samples."""
    n_sample: int
    """Of the signals."""

    @property
    def n_period(self) -> int:
        """Whole periods that were recorded."""
        return self.n_sample // self.lag

    @property
    def is_whole(self) -> bool:
        """Whether the period is a whole number of samples, as far as the recording can tell."""
        return abs(self.exact - round(self.exact)) <= WHOLE * self.exact / self.n_sample + SIGMAS * self.error


def differences(signals: FloatArray) -> FloatArray:
    """Return d(p) of signals (n_sample, n_signal) for p up to 0.55 n_sample, over all signals that move.

    Raises DataRejected where none moves.
    """
    moving = _moving(signals)
    if not moving.any():
        raise DataRejected("nothing moves in the recording, and no period can be found")
    centred = signals[:, moving] - signals[:, moving].mean(axis=0)
    unit = centred / centred.std(axis=0)
    n = len(unit)
    spectrum = np.fft.rfft(unit, scipy.fft.next_fast_len(2 * n), axis=0)
    product = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=1), scipy.fft.next_fast_len(2 * n))
    power = np.concatenate([[0.0], np.cumsum((unit**2).sum(axis=1))])
    lag = np.arange(int(LONGEST * n) + 1)
    energy = power[n - lag] + power[n] - power[lag]
    result: FloatArray = np.maximum(1 - 2 * product[lag] / energy, 0.0)
    return result


@np.errstate(over="ignore", invalid="ignore")  # squares of numbers near the largest of all
def _moving(signals: FloatArray) -> BoolArray:
    """Which signals are more than rounding about their mean; none whose squares no number holds."""
    size = signals.std(axis=0)
    moving: BoolArray = np.isfinite(size) & (size > 1e-12 * np.maximum(np.abs(signals).max(axis=0), 1e-300))
    return moving


def shortest_lag(d: FloatArray) -> int | None:
    """Return the shortest lag at which d, as `differences` gives it, is as small as anywhere; None without a minimum.

    Whether anything repeats after it, its d tells.
    """
    away = np.flatnonzero(d > UNRELATED)
    lags = _minima(d, int(away[0]) if len(away) else len(d))
    if not len(lags):
        return None
    best = float(d[lags].min())
    most = max(ALIKE * best, ROUNDING)
    return int(lags[d[lags] <= (min(most, REPEATS) if best <= REPEATS else most)][0])


def repetition_of(signals: FloatArray) -> Repetition | None:
    """Return the shortest period of signals (n_sample, n_signal), None where nothing repeats twice.

    Raises DataRejected where nothing moves.
    """
    d = differences(signals)
    lag = shortest_lag(d)
    if lag is None or not d[lag] <= REPEATS:
        return None
    exact, error = _refined(d, lag, len(signals))
    return Repetition(round(exact), float(d[lag]), exact, error, len(signals))


def steady_repetition(position: FloatArray, torque: FloatArray | None = None) -> Repetition | None:
    """Return the period of a motion that ends in a steady state; None where it does not repeat so well.

    A program that is run again repeats, too, but hardly at the same instant of the sampling clock: its runs differ by
    more than half of what moves within a sample.

    Parameters
    ----------
    position
        (n_sample, n_axis), in one unit; NaN in axes that are not known throughout.
    torque
        The same; where it is given, it tells the period, of which it has more than a position.
    """
    moves = position[:, np.isfinite(position).all(axis=0)]
    known = moves if torque is None else torque[:, np.isfinite(torque).all(axis=0)]
    if (
        len(known) < FEWEST
        or len(known) != len(moves)
        or not _moving(known).any()
        or not _moving(moves).any()
    ):
        return None
    found = repetition_of(known)
    if found is None or not found.is_whole or found.n_period < 2:
        return None
    last = moves[-found.lag :]
    within = np.sqrt((np.diff(last, axis=0) ** 2).mean() / np.maximum(last.var(axis=0).mean(), 1e-300))
    return found if last_change(moves, found.lag) <= FAITHFUL * within else None


@np.errstate(over="ignore", invalid="ignore")
def last_change(signals: FloatArray, lag: int) -> float:
    """Return the rms difference of the last two periods of `lag` samples, over the rms of the last one less its mean.

    Signals are (n_sample, n_signal), in one unit; those that are not known throughout do not count.
    """
    known = signals[:, np.isfinite(signals).all(axis=0)]
    before, last = known[-2 * lag : -lag], known[-lag:]
    return float(np.sqrt(((last - before) ** 2).mean() / np.maximum(last.var(axis=0).mean(), 1e-300)))


def _minima(d: FloatArray, first: int) -> IntArray:
    """Lags of local minima from `first` on, the last lag too."""
    inner = np.flatnonzero((d[1:-1] <= d[:-2]) & (d[1:-1] <= d[2:])) + 1
    last = [len(d) - 1] if len(d) > 1 and d[-1] < d[-2] else []
    found = np.concatenate([inner, last]).astype(np.int64)
    return found[found >= max(first, 2)]


def _refined(d: FloatArray, lag: int, n_sample: int) -> tuple[float, float]:
    """Period near `lag` and its standard error, from the minimum at the longest multiple of it that is seen.

    About a minimum d = d_0 + c (p - p_0)^2, for fast moves only as far as the noise is deep. With N samples that are
    compared, p_0 has the variance d_0 / (c N).
    """
    exact, error = float(lag), 0.0
    for multiple in range(1, (len(d) - 1) // lag + 1):
        centre = round(multiple * exact)
        near = np.arange(max(centre - 2, 1), min(centre + 3, len(d)))
        place = int(near[np.argmin(d[near])])
        top = d[place] + min(d[place], BOTTOM)
        width = 1
        while (
            2 * width < lag // 4
            and place + width + 1 < len(d)
            and (max(d[place - width], d[place + width]) < top)
        ):
            width += 1
        around = np.arange(place - width, min(place + width + 1, len(d)))
        if len(around) < 3:
            continue
        c, slope, _ = np.polyfit(around - place, d[around], 2)
        if c <= 0:
            continue
        exact = (place + float(np.clip(-slope / (2 * c), -2.0, 2.0))) / multiple
        error = float(np.sqrt(d[place] / (c * (n_sample - place)))) / multiple
    return exact, error
