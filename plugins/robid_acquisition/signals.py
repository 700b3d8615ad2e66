"""Samples of one experiment: between two times, on their side of the gear, in whole periods."""

from __future__ import annotations

import numpy as np

from robid_core import DataRejected, FloatArray

BEYOND = 1e-3  # of a recording: a time so much behind its end is the end, as another clock says it


def window(
    n_sample: int,
    sample_time: float,
    start_s: float,
    stop_s: float | None,
    drop_first_s: float = 0.0,
    drop_last_s: float = 0.0,
) -> slice:
    """Return the samples between two times, without beginning and end; DataRejected where less than two are left."""
    first = round(start_s / sample_time)
    stop = n_sample if stop_s is None else min(n_sample, first + round((stop_s - start_s) / sample_time))
    first, stop = first + round(drop_first_s / sample_time), stop - round(drop_last_s / sample_time)
    if stop - first < 2:
        dropped = drop_first_s + drop_last_s
        raise DataRejected(
            f"nothing lies between {start_s:g} s and {'its end' if stop_s is None else f'{stop_s:g} s'}"
            f"{f' once {dropped:g} s are dropped' if dropped else ''}; it lasts {n_sample * sample_time:g} s"
        )
    return slice(first, stop)


def refuse_beyond(n_sample: int, sample_time: float, stop_s: float | None) -> None:
    """Raise DataRejected where a stretch should end behind the end of its file."""
    lasts = n_sample * sample_time
    if stop_s is not None and stop_s > lasts * (1 + BEYOND) + sample_time:
        raise DataRejected(
            f"stop_s of {stop_s:g} s is beyond the end: the file lasts {lasts:g} s; correct it, or leave it out"
        )


def samples_per_period(n_sample: int, sample_time: float, period_s: float | None) -> int:
    """Return how many samples a period has, all of them where nothing repeats.

    Raises
    ------
    DataRejected
        If a period is no whole number of samples (fault A09), or longer than the recording (A11).
    """
    if period_s is None:
        return n_sample
    exact = period_s / sample_time
    whole = round(exact)
    # A tenth of a sample over the whole recording leaks less than the noise of any encoder.
    if whole < 1 or abs(exact - whole) * (n_sample / max(whole, 1)) > 0.1:
        raise DataRejected(
            f"A09: a period of {period_s:g} s is {exact:.6g} samples of {sample_time:g} s, not a whole "
            "number; correct period_s or resample"
        )
    if n_sample < whole:
        raise DataRejected(
            f"A11: {n_sample * sample_time:g} s were recorded, less than a period of {period_s:g} s; "
            "correct period_s, or leave it out where nothing repeats"
        )
    return whole


def split_periods(values: FloatArray, n_per_period: int) -> FloatArray:
    """Cut whole periods, the rest dropped: (n_sample, n_axis) to (n_period, n_per_period, n_axis)."""
    n_period = len(values) // n_per_period
    return values[: n_period * n_per_period].reshape(n_period, n_per_period, -1)


def to_side(values: FloatArray, name: str, given: str, wanted: str, gear: FloatArray) -> FloatArray:
    """Bring values through the gear: joint = gear @ motor for motion, motor = gear^T @ joint for torque.

    Parameters
    ----------
    values
        Shape (n_sample, n_axis).
    name
        Channel; one with "torque" in it is a torque, any other of position, speed, acceleration is motion.
    given, wanted
        "motor" or "joint".
    gear
        r_g, shape (n_axis, n_axis).
    """
    if given == wanted or not any(word in name for word in ("position", "speed", "acceleration", "torque")):
        return values
    if np.isnan(values).all(axis=0).any() and np.count_nonzero(gear - np.diag(np.diag(gear))):
        raise DataRejected(
            f"channel {name}: the gears are coupled; all axes are needed to bring it to the {wanted} side"
        )
    matrix = gear.T if "torque" in name else np.linalg.inv(gear)
    if wanted == "joint":
        matrix = np.linalg.inv(matrix)
    if not np.count_nonzero(gear - np.diag(np.diag(gear))):
        result: FloatArray = values * np.diag(matrix)
        return result
    return values @ matrix.T
