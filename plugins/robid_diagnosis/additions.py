"""From a candidate that gains to an effect in the robot: its values, its name, which numbers are estimated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import RobidError
from robid_diagnosis.candidates import Candidate
from robid_diagnosis.columns import WHOLE, Motion
from robid_diagnosis.hypothesis import Addition, Hypothesis
from robid_diagnosis.search import Hit, Search, parameters_of
from robid_diagnosis.structures import CONTINUOUS

PROPORTIONAL = 1e-3  # of a law's torque: what it may differ from twice that of half the parameters
CHANGE = 0.01  # of a parameter
SMALL = 0.02  # of the relative change of a parameter: one whose law changes by less stays as it is
SEEN = 3.0  # standard deviations of noise that a whole parameter is worth: estimated, however small its part of the law
TOLD = 1.0  # standard deviations per logarithm: likewise, where the robot itself is changed


def addition_of(hit: Hit, search: Search, label: str) -> Addition:
    """Return the effect with the values that the search found."""
    candidate = hit.candidate
    scaled = scaled_parameters(candidate, hit.values, search.motion)
    values = parameters_of(hit, scaled)
    rows = {row.name: row for row in candidate.effect.parameters}
    free = {hit.meaning.names[i] for i in hit.gain.chosen if hit.meaning.names[i] != WHOLE}
    free |= {*candidate.shape, *scaled} | ({"phase"} if hit.meaning.paired else set())
    free |= {row.name for row in candidate.effect.parameters if row.unit == "1" and row.default > 0}
    free -= set(candidate.effect.smoothest)
    whole = search.motion.whole(candidate, values)
    least = min(SMALL * float(np.linalg.norm(whole)), SEEN)
    if candidate.place is None:
        free |= {row.name for row in candidate.effect.parameters if row.unit in CONTINUOUS}
        least = TOLD

    def counts(name: str) -> bool:
        """Whether a parameter is within its bounds, and the torque changes with it."""
        row, value = rows[name], values[name]
        if not row.lower < value < row.upper and name != "phase":
            return False
        moved = {**values, name: value + CHANGE if name in ("order", "phase") else value * (1 + CHANGE)}
        try:
            change = search.motion.whole(candidate, moved) - whole
        except RobidError:
            return True
        return bool(np.linalg.norm(change) > CHANGE * least)

    kept = tuple(row.name for row in candidate.effect.parameters if row.name in free and counts(row.name))
    return Addition(label, candidate.use, candidate.spot.on, candidate.spot.side or None, values, kept)


def label_of(hit: Hit, hypothesis: Hypothesis) -> str:
    """Name of an effect in the robot file: what it is and where, `stribeck_axis_1`."""
    name = f"{hit.candidate.use.rpartition('.')[2]}_{hit.candidate.spot.on}"
    taken = sum(one.label.startswith(name) for one in hypothesis.additions)
    return f"{name}_{taken + 1}" if taken else name


def is_fixed(hit: Hit, search: Search) -> bool:
    """Whether a law is in proportion to none of its parameters: its size is told by its shape alone."""
    if hit.meaning.names != (WHOLE,):
        return False
    return not scaled_parameters(hit.candidate, hit.values, search.motion)


def scaled_parameters(candidate: Candidate, values: Mapping[str, float], motion: Motion) -> tuple[str, ...]:
    """Parameters to which, all together, a law is proportional that is linear in none; empty where it is not.

    Parameters
    ----------
    candidate, values
        The law at its place, and values in place of the candidate's.
    motion
        Along which it is evaluated.
    """
    columns = motion.columns(candidate, values)
    if WHOLE not in columns.meaning.names:
        return ()
    rows = candidate.effect.parameters

    def is_proportional(names: tuple[str, ...]) -> bool:
        """Whether half the values of some parameters give half the torque."""
        half = {name: 0.5 * {**candidate.values, **values}[name] for name in names}
        try:
            less = motion.columns(candidate, {**values, **half}).rows
        except RobidError:
            return False
        off = np.linalg.norm(2 * less - columns.rows) / np.linalg.norm(columns.rows)
        return bool(off < PROPORTIONAL)

    if candidate.signed:
        return tuple(row.name for row in rows if is_proportional((row.name,)))
    if columns.meaning.paired:
        names = tuple(row.name for row in rows if row.name not in ("order", "phase"))
    else:
        names = tuple(row.name for row in rows if row.unit.startswith("N m"))
    return names if names and is_proportional(names) else ()
