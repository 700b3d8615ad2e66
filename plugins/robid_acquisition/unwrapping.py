"""Counters and angles that wrap, made continuous."""

from __future__ import annotations

import numpy as np

from robid_core import DataRejected, FloatArray

AMBIGUOUS = 0.4  # of what a value wraps at: a larger step may have gone the other way round


def unwrapped(values: FloatArray, wrap: float, instant: FloatArray, name: str) -> FloatArray:
    """Return values without their jumps by multiples of `wrap`, each step as short as it can be.

    Parameters
    ----------
    values
        Shape (n_sample,), NaN where nothing was measured.
    wrap
        What they wrap at, in their own unit.
    instant
        When they were measured, in samples, (n_sample,): between two that lie n apart, n of the longest of all steps of
        one sample may lie.
    name
        For messages.

    Raises
    ------
    DataRejected
        If the values span more than `wrap`, or a step can be taken either way round.
    """
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return values
    given = values[known]
    if np.ptp(given) > wrap * (1 + 1e-9):
        raise DataRejected(
            f"{name}: the values span {np.ptp(given):g} and cannot wrap at {wrap:g}; correct wrap"
        )
    steps = np.diff(given)
    steps -= wrap * np.round(steps / wrap)
    apart = np.diff(instant[known])
    alone = apart < 1.5  # samples
    fastest = np.abs(steps[alone]).max(initial=0.0)
    reach = np.where(alone, np.abs(steps), apart * fastest)
    if (reach > AMBIGUOUS * wrap).any():
        first = int(np.argmax(reach > AMBIGUOUS * wrap))
        raise DataRejected(
            f"{name}: the step at sample {known[first + 1]} may have gone either way round ({steps[first]:.4g} of "
            f"{wrap:g}, {apart[first]:.3g} samples apart); record faster, or cut the recording there"
        )
    result = np.full_like(values, np.nan)
    result[known] = given[0] + np.concatenate([[0.0], np.cumsum(steps)])
    return result
