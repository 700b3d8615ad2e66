"""Samples and steps of a robot file: a sample has a whole number of integration steps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from robid_core.yaml_file.problems import KeyPath

LONGEST_STEP_S = 0.00025  # of the steps that a file leaves to robid


def clock_contradictions(sample_time: Any, step: Any) -> Iterator[tuple[KeyPath, str]]:
    """Yield what is wrong with a step, with the one that would be right."""
    if not (_is_time(sample_time) and _is_time(step)):
        return
    ratio = sample_time / step
    if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        yield (
            ("step_s",),
            f"sample_time_s {sample_time:g} s is not a whole number of steps of {step:g} s; give a step of "
            f"{sample_time / max(1, round(ratio)):g} s",
        )


def whole_step(sample_time: Any) -> float:
    """Return the longest step up to LONGEST_STEP_S of which a sample has a whole number."""
    if not _is_time(sample_time) or sample_time / LONGEST_STEP_S > 1e9:
        return LONGEST_STEP_S  # no time: told elsewhere
    count = math.ceil(sample_time / LONGEST_STEP_S * (1 - 1e-9))
    step = float(sample_time / count)
    return LONGEST_STEP_S if math.isclose(step, LONGEST_STEP_S, rel_tol=1e-9) else step


def _is_time(value: Any) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool) and 0 < value < math.inf
