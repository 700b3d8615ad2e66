"""Period and lines of the channels of a record: which channels tell them, and what they say of a claim."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_acquisition.assembly import Index
from robid_acquisition.claimed_period import doubts_of_period, samples_of_period
from robid_acquisition.excited_lines import doubts_of_lines, find_lines
from robid_core import DataRejected, FloatArray, IntArray
from robid_core.estimation.repetition import steady_repetition

# In this order: a reference has neither noise nor harmonics of friction.
TELLING = ("speed_reference", "position_reference", "motor_torque")
MEASURED = ("motor_torque", "motor_speed", "motor_position")


def found_period(values: Mapping[str, FloatArray], sample_time_s: float) -> float:
    """Return the period of an experiment in s; `values` are its channels, (1, n_sample, n_axis) each."""
    return samples_of_period(_measured(values)[0], sample_time_s) * sample_time_s


def clock_of_period(values: Mapping[str, FloatArray], period_s: float) -> str:
    """Say at which sample time an experiment would repeat after its period; empty where it does not repeat.

    Parameters
    ----------
    values
        Channels, (n_sample, n_axis) each.
    period_s
        Of the excitation, as whoever made it knows it.
    """
    try:
        n_sample = samples_of_period(_measured(values), 1.0)
    except DataRejected:
        return ""
    return (
        f"; the recording repeats every {n_sample} samples: sample_time_s is {period_s / n_sample:.6g} where period_s "
        "is right"
    )


def words_of_untold_period(
    channels: Mapping[str, FloatArray], sample_time_s: float
) -> tuple[Index, str] | None:
    """Say that an experiment repeats though no period was given, and which does, by its place in the channels.

    Channels are (n_config, n_block, n_exp, 1, n_sample, n_axis).
    """
    if "motor_position" not in channels:
        return None
    position, torque = channels["motor_position"], channels.get("motor_torque")
    for c, b, e in np.ndindex(*position.shape[:3]):
        place = c, b, e
        found = steady_repetition(position[place][0], None if torque is None else torque[place][0])
        if found is not None:
            return place, (
                f"it repeats every {found.lag * sample_time_s:.6g} s ({found.n_period} times), and no period_s is "
                "given; with period_s: auto and lines: auto its single periods are used: their differences show the "
                "noise, and fits, and diagnoses of four experiments or more, are several times faster (period_s: null: "
                "one long motion)"
            )
    return None


def doubts_of_claimed_period(
    channels: Mapping[str, FloatArray], sample_time_s: float
) -> list[tuple[Index, str]]:
    """Say what an experiment has against its period, the first one for each; and which, by its place in the channels.

    Channels are (n_config, n_block, n_exp, n_period, n_sample, n_axis).
    """
    signals = _measured(channels)
    n_per_period, n_signal = signals.shape[-2:]
    said: dict[str, tuple[Index, str]] = {}
    for c, b, e in np.ndindex(*signals.shape[:3]):
        one = signals[c, b, e].reshape(-1, n_signal)
        if np.ptp(one, axis=0).any():
            for words in doubts_of_period(one, n_per_period, sample_time_s):
                said.setdefault(
                    " ".join(words.split()[:2]), ((c, b, e), words)
                )  # the recording, or the first period
    return list(said.values())


def found_lines(channels: Mapping[str, FloatArray]) -> tuple[IntArray, str]:
    """Return the excited lines of a record's channels, and how they were found, in words."""
    name, signals = _telling(channels)
    lines, words = find_lines(signals)
    return lines, f"in {name}, {words}"


def doubts_of_claimed_lines(channels: Mapping[str, FloatArray], lines: IntArray) -> list[str]:
    """Say which lines do not stand out; raises DataRejected where one cannot be."""
    if not any(name in channels for name in TELLING):
        return []
    name, signals = _telling(channels)
    return [f"{words} ({name})" for words in doubts_of_lines(signals, lines)]


def _telling(channels: Mapping[str, FloatArray]) -> tuple[str, FloatArray]:
    """Name of the channel that tells the lines, and its values, (n_experiment, n_period, n_sample, n_axis)."""
    for name in TELLING:
        if name in channels:
            values = channels[name]
            kept = np.isfinite(values).all(axis=tuple(range(values.ndim - 1)))
            return name, values.reshape(-1, *values.shape[3:])[..., kept]
    raise DataRejected(f"lines: auto: none of {', '.join(TELLING)} was recorded; give the lines")


def _measured(channels: Mapping[str, FloatArray]) -> FloatArray:
    """Torque, or else motion, of the axes that it covers, periods as they are."""
    for name in (*MEASURED, *channels):
        if name in channels:
            values = channels[name]
            kept = np.isfinite(values).all(axis=tuple(range(values.ndim - 1)))
            if kept.any():
                return values[..., kept]
    raise DataRejected("period_s: auto: no channel is known throughout; give period_s")
