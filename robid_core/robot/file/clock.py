"""Samples and steps of a robot file: a sample has a whole number of integration steps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from robid_core.yaml_file.problems import KeyPath

LONGEST_STEP_S = 0.00025  # of the steps that a file leaves to robid
LONGEST_SAMPLE_S = 10.0  # no drive is slower; a rate in Hz is larger
SHORTEST_SAMPLE_S = 1e-7  # no drive is faster
MOST_STEPS = 10_000  # in a sample: more take hours for a motion of seconds


def clock_contradictions(sample_time: Any, step: Any) -> Iterator[tuple[KeyPath, str]]:
    """Yield what is wrong with a step, with the one that would be right."""
    if not (_is_time(sample_time) and _is_time(step)):
        return
    if not SHORTEST_SAMPLE_S <= sample_time <= LONGEST_SAMPLE_S:
        yield (
            ("sample_time_s",),
            f"{sample_time:g} s is no sample time of a drive, which lies between {SHORTEST_SAMPLE_S:g} and "
            f"{LONGEST_SAMPLE_S:g} s; give seconds a sample, not a rate in Hz: 1 kHz is 0.001",
        )
        return
    ratio = sample_time / step
    if ratio > MOST_STEPS:
        yield (
            ("step_s",),
            f"{step:g} s makes {ratio:.3g} steps in a sample of {sample_time:g} s; give at least "
            f"{sample_time / MOST_STEPS:g} s, or leave it out",
        )
        return
    if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        yield (
            ("step_s",),
            f"sample_time_s {sample_time:g} s is not a whole number of steps of {step:g} s; give a step of "
            f"{sample_time / max(1, round(ratio)):g} s",
        )


def whole_step(sample_time: Any) -> float:
    """Return the longest step up to LONGEST_STEP_S of which a sample has a whole number."""
    if not _is_time(sample_time) or not SHORTEST_SAMPLE_S <= sample_time <= LONGEST_SAMPLE_S:
        return LONGEST_STEP_S  # no time: told elsewhere
    count = math.ceil(sample_time / LONGEST_STEP_S * (1 - 1e-9))
    step = float(sample_time / count)
    return LONGEST_STEP_S if math.isclose(step, LONGEST_STEP_S, rel_tol=1e-9) else step


def _is_time(value: Any) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool) and 0 < value < math.inf
