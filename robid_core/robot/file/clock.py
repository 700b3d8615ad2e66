"""Samples and steps of a robot file: a sample has a whole number of integration steps.

A light motor behind an elastic gear follows its friction within a fraction of a sample: its speed fades in ``J v / c``
about standstill, J the rotor's inertia, c the Coulomb level, v the speed within which that turns round. Steps that do
not resolve this give another friction than the file's, by more than sensors' noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from robid_core.yaml_file.problems import KeyPath

LONGEST_STEP_S = 0.00025  # of the steps that a file leaves to robid
SHORTEST_STEP_S = LONGEST_STEP_S / 16  # likewise: friction that turns faster is left unresolved
FOLLOWING = 2.5  # steps within the time in which a motor follows its friction, or more
COULOMB_SPEED = 0.5  # rad/s: the zero-speed width of friction that tells none
SHORTEST_SAMPLE_S = 1e-7  # no drive is faster
MOST_STEPS = 10_000  # in a sample: more take hours for a motion of seconds
LONGEST_SAMPLE_S = MOST_STEPS * LONGEST_STEP_S  # no drive is slower; a rate in Hz is larger


def clock_contradictions(sample_time: Any, step: Any) -> Iterator[tuple[KeyPath, str]]:
    """Yield what is wrong with a step, with the one that would be right."""
    if not (_is_positive(sample_time) and _is_positive(step)):
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


def default_step(sample_time: Any, axes: Any) -> float:
    """Return the step of a file that gives none, s: a sample has a whole number, and motors follow their friction.

    `axes`: of the file as it was read. Steps are halved until motors follow, so that a friction that a fit changes by a
    tenth seldom changes the step.
    """
    if not _is_positive(sample_time) or not SHORTEST_SAMPLE_S <= sample_time <= LONGEST_SAMPLE_S:
        return LONGEST_STEP_S  # no time: told elsewhere
    count = math.ceil(sample_time / LONGEST_STEP_S * (1 - 1e-9))
    step = float(sample_time / count)
    step = LONGEST_STEP_S if math.isclose(step, LONGEST_STEP_S, rel_tol=1e-9) else step
    entries = axes.values() if isinstance(axes, Mapping) else ()
    fastest = min(
        (following_time(entry) for entry in entries if isinstance(entry, Mapping)), default=math.inf
    )
    wanted = min(step, max(fastest / FOLLOWING, SHORTEST_STEP_S))
    return step * 2.0 ** math.floor(math.log2(wanted / step))


def following_time(axis: Mapping[str, Any]) -> float:
    """Return the time in which a motor follows its friction, s; infinite without any, or before a rigid gear.

    There the arm moves, too. Entries of the file that are no numbers are told elsewhere.
    """
    friction = axis.get("friction", {})
    if not isinstance(friction, Mapping) or axis.get("gear") is None:
        return math.inf
    values = (axis.get("rotor_inertia"), friction.get("coulomb"), friction.get("speed", COULOMB_SPEED))
    if not all(_is_positive(value) for value in values):
        return math.inf
    inertia, coulomb, speed = values
    return float(inertia * speed / coulomb)


def _is_positive(value: Any) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool) and 0 < value < math.inf
