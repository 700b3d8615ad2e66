"""A period in samples that `period_s: auto` finds, and what speaks against one that was given."""

from __future__ import annotations

import numpy as np

from robid_core import DataRejected, FloatArray
from robid_core.estimation.repetition import (
    REPEATS,
    ROUNDING,
    differences,
    repetition_of,
    shortest_lag,
)

ANOTHER = 10.0  # factor on d by which another period must be better to contradict a claim
TRANSIENT = 2.0  # factor on the rms difference to the last period, of the first one and of later ones
SLIGHT = 1e-3  # of a signal: transients below it are none


def samples_of_period(signals: FloatArray, sample_time_s: float) -> int:
    """Return the shortest period of signals (n_sample, n_signal), in samples.

    Raises
    ------
    DataRejected
        If nothing repeats twice, or the period is no whole number of samples.
    """
    found = repetition_of(signals)
    if found is None:
        raise DataRejected(
            f"period_s: auto: nothing repeats within {len(signals) * sample_time_s / 2:.4g} s, half of the recording; "
            "give period_s, or leave it out where the motion does not repeat"
        )
    if not found.is_whole:
        raise DataRejected(
            f"A09: the recording repeats every {found.exact * sample_time_s:.7g} s, which is {found.exact:.6g} samples "
            "and not a whole number; resample it to a whole one (time_column, resample, sample_time_s)"
        )
    return found.lag


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
        claimed, other = float(d[n_per_period]), shortest_lag(d)
        if (
            other is not None
            and d[other] <= REPEATS
            and claimed > max(ANOTHER * d[other], ROUNDING, SLIGHT**2)
        ):
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
        "the motion has not settled; stages that follow leave such periods out (discard: null, the default)"
    ]
