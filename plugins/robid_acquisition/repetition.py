"""Whether a recording repeats, after how many samples, and whether a claimed period is one.

The difference of a signal from itself p samples later, as a share of what two unrelated pieces would differ by,

    d(p) = sum_t |x(t + p) - x(t)|^2 / sum_t (|x(t + p)|^2 + |x(t)|^2),

is 1 where nothing repeats and the noise's share where p is a period (difference function, de Cheveigne and Kawahara
2002). Signals are taken less their mean, each to unit variance.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core import DataRejected, FloatArray

REPEATS = 0.1  # of d: above, nothing repeats
LONGEST = 0.55  # of the recording: two periods, and what lies beside the minimum
UNRELATED = 0.5  # of d: a lag at which the signal has turned away from itself
ALIKE = 4.0  # factor on the smallest d, within which a shorter period is one as well
WHOLE = 0.2  # samples over the whole recording, by which a period may miss a whole number, beside its error
SIGMAS = 4.0  # of that error
BOTTOM = 0.15  # of d above its minimum: how far its course is taken for a parabola
ROUNDING = 1e-9  # of d
ANOTHER = 10.0  # factor on d by which another period must be better to contradict a claim
TRANSIENT = 2.0  # factor on the rms difference to the last period, of the first one and of later ones
SLIGHT = 1e-3  # of a signal: transients below it are none


def differences(signals: FloatArray) -> FloatArray:
    """Return d(p) of signals (n_sample, n_signal) for p up to 0.55 n_sample, over all signals that move."""
    centred = signals - signals.mean(axis=0)
    size = centred.std(axis=0)
    moving = size > 1e-12 * np.maximum(np.abs(signals).max(axis=0), 1e-300)
    if not moving.any():
        raise DataRejected("nothing moves in the recording; period_s: auto has nothing to go by")
    unit = centred[:, moving] / size[moving]
    n = len(unit)
    spectrum = np.fft.rfft(unit, scipy.fft.next_fast_len(2 * n), axis=0)
    product = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=1), scipy.fft.next_fast_len(2 * n))
    power = np.concatenate([[0.0], np.cumsum((unit**2).sum(axis=1))])
    lag = np.arange(int(LONGEST * n) + 1)
    energy = power[n - lag] + power[n] - power[lag]
    result: FloatArray = np.maximum(1 - 2 * product[lag] / energy, 0.0)
    return result


def samples_of_period(signals: FloatArray, sample_time_s: float) -> int:
    """Return the shortest period of signals (n_sample, n_signal), in samples.

    Raises
    ------
    DataRejected
        If nothing repeats twice, or the period is no whole number of samples.
    """
    d = differences(signals)
    away = np.flatnonzero(d > UNRELATED)
    first = int(away[0]) if len(away) else len(d)
    lags = _minima(d, first)
    best = float(d[lags].min(initial=1.0))
    if best > REPEATS:
        raise DataRejected(
            f"period_s: auto: nothing repeats within {len(signals) * sample_time_s / 2:.4g} s, half of the recording; "
            "give period_s, or leave it out where the motion does not repeat"
        )
    shortest = int(lags[d[lags] <= max(ALIKE * best, ROUNDING)][0])
    exact, error = _refined(d, shortest, len(signals))
    if abs(exact - round(exact)) > WHOLE * exact / len(signals) + SIGMAS * error:
        raise DataRejected(
            f"A09: the recording repeats every {exact * sample_time_s:.7g} s, which is {exact:.6g} samples and not a "
            "whole number; resample it to a whole one (time_column, resample, sample_time_s)"
        )
    return round(exact)


def _minima(d: FloatArray, first: int) -> np.ndarray:
    """Lags of local minima from `first` on, the last lag too."""
    inner = np.flatnonzero((d[1:-1] <= d[:-2]) & (d[1:-1] <= d[2:])) + 1
    last = [len(d) - 1] if len(d) > 1 and d[-1] < d[-2] else []
    found = np.concatenate([inner, last]).astype(np.int64)
    return found[found >= max(first, 2)]


def _refined(d: FloatArray, lag: int, n_sample: int) -> tuple[float, float]:
    """Period near `lag` and its standard error, from the minimum at the longest multiple of it that is seen.

    About a minimum d = d_0 + c (p - p_0)^2. With N samples that are compared, p_0 has the variance d_0 / (c N).
    """
    exact, error = float(lag), 0.0
    for multiple in range(1, (len(d) - 1) // lag + 1):
        centre = round(multiple * exact)
        near = np.arange(max(centre - 2, 1), min(centre + 3, len(d)))
        place = int(near[np.argmin(d[near])])
        width = 1
        while (
            2 * width < lag // 4
            and place + width + 1 < len(d)
            and (max(d[place - width], d[place + width]) < d[place] + BOTTOM)
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


def doubts_of_period(signals: FloatArray, n_per_period: int, sample_time_s: float) -> list[str]:
    """Say what speaks against a claimed period of signals (n_sample, n_signal): another one, or a transient.

    Raises
    ------
    DataRejected
        If the recording repeats with another period, and not at all with this one.
    """
    words = []
    if len(signals) >= 2 * n_per_period:
        d = differences(signals)
        claimed = float(d[n_per_period])
        away = np.flatnonzero(d > UNRELATED)
        lags = _minima(d, int(away[0]) if len(away) else len(d))
        if len(lags):
            other = int(lags[np.argmin(d[lags])])
            shorter = lags[d[lags] <= max(ALIKE * d[other], ROUNDING)]
            other = int(shorter[0])
            if d[other] <= REPEATS and claimed > max(ANOTHER * d[other], ROUNDING, SLIGHT**2):
                share = 100 * np.sqrt(claimed)
                told = (
                    f"the recording repeats every {other * sample_time_s:.6g} s; after the period_s of "
                    f"{n_per_period * sample_time_s:.6g} s it differs from itself by {share:.3g} % of what unrelated "
                    "pieces do"
                )
                clock = n_per_period * sample_time_s / other
                mend = f"correct period_s, or the clock where that is wrong (sample_time_s: {clock:.6g})"
                if claimed > REPEATS:
                    raise DataRejected(f"A09: {told}; {mend}")
                words.append(f"{told}; {mend}")
    return [*words, *_transient(signals, n_per_period)]


def _transient(signals: FloatArray, n_per_period: int) -> list[str]:
    """Say where the first of three or more periods is not like the later ones."""
    n_period = len(signals) // n_per_period
    if n_period < 3:
        return []
    periods = signals[: n_period * n_per_period].reshape(n_period, n_per_period, -1)
    size = np.maximum(periods[-1].std(axis=0), 1e-300)
    away = np.sqrt((((periods[:-1] - periods[-1]) / size) ** 2).mean(axis=(1, 2)))
    later = float(away[1:].max())
    if away[0] <= max(TRANSIENT * later, SLIGHT):
        return []
    return [
        f"the first period differs from the last by {100 * away[0]:.2g} % (rms), later ones by {100 * later:.2g} %: "
        "the motion has not settled; drop_first_s, or discard: 1 in the stages that follow"
    ]
