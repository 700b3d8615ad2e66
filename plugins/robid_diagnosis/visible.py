"""Smallest sizes of effects that a search would have found: what "nothing significant" excludes.

A law of size s gains s^2 S of twice the log-likelihood on average, S what is left of its column's square once
everything that was fitted may move. It is found in nine of ten records where that is (sqrt(G) + 1.28)^2, G the gain
that is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import FloatArray, VisibleSize
from robid_diagnosis.candidates import Candidate
from robid_diagnosis.columns import WHOLE

NINE_OF_TEN = 1.28  # standard deviations


@dataclass(frozen=True, eq=False)
class Power:
    """How much twice the log-likelihood rises per square of each parameter of one candidate."""

    candidate: Candidate
    of: Mapping[str, float]
    """Gain per square of each parameter in its unit; of `*` for the law as it is."""


def power_of(
    candidate: Candidate, names: Sequence[str], square: FloatArray, matrix: FloatArray, blind: float
) -> Power:
    """Return the powers of one candidate.

    Parameters
    ----------
    candidate, names
        The candidate, and the parameter of each of its columns.
    square
        Of these, (n_column,).
    matrix
        Their normal equations, the fit projected out, (n_column, n_column).
    blind
        Share of a column's square: where less is left, the fit's own unknowns can do the same.
    """
    found = {}
    for name in dict.fromkeys(names):
        rows = [i for i, own in enumerate(names) if own == name]
        least = float(np.linalg.eigvalsh(matrix[np.ix_(rows, rows)])[0])  # of a wave: at its worst phase
        if least > blind * float(square[rows].min()):
            found[name] = least
    return Power(candidate, found)


def visible_sizes(
    powers: Mapping[tuple[str, str, str], Sequence[Power]],
    scaled: Callable[[Candidate], Sequence[str]],
    least: Callable[[Candidate], float],
    chance: float,
) -> tuple[VisibleSize, ...]:
    """Return the smallest size of every effect at every place that would have been found.

    Parameters
    ----------
    powers
        Of every candidate, by effect and place.
    scaled
        Tells to which parameters a law is proportional that is linear in none.
    least, chance
        Gain, of an effect at its place, and p-value that are needed.
    """
    found = []
    known: dict[
        tuple[str, str], Sequence[str]
    ] = {}  # what a law is in proportion to somewhere, it is everywhere

    def scaled_by(candidate: Candidate) -> Sequence[str]:
        law = candidate.use, candidate.spot.side
        if not known.get(law):
            known[law] = scaled(candidate)
        return known[law]

    for (use, on, side), own in powers.items():
        units = {row.name: row.unit for row in own[0].candidate.effect.parameters}
        gain = max(least(own[0].candidate), scipy.stats.chi2.isf(chance, 1))
        needed = float((np.sqrt(gain) + NINE_OF_TEN) ** 2)
        for name, size in _sizes(own, scaled_by, needed):
            found.append(VisibleSize(use, on, side, name, units[name], size))
    return tuple(found)


def _sizes(
    powers: Sequence[Power], scaled: Callable[[Candidate], Sequence[str]], needed: float
) -> Iterator[tuple[str, float]]:
    """Sizes at the worst of the shapes that were tried."""
    for name in powers[0].of:
        if any(name not in power.of for power in powers):
            continue
        each = np.array([power.of[name] for power in powers])
        first = powers[0].candidate
        if name != WHOLE and name not in first.springs:
            yield name, float(np.sqrt(needed / each.min()))
            continue
        units = {row.name: row.unit for row in first.effect.parameters}
        names = sorted(scaled(first), key=lambda one: units[one] != "N m")
        shape = (name,) if name in first.springs else first.shape
        if names:
            told = np.array([power.candidate.values[names[0]] for power in powers])
            yield names[0], float((told * np.sqrt(needed / each)).max())
        elif shape and len(powers) > 1:
            told = np.array([power.candidate.values[shape[0]] for power in powers])
            falling = bool(first.springs) or units[shape[0]] == "N m"  # springs that give way, limits
            size = threshold(told, each, needed, falling)
            if np.isfinite(size):
                yield shape[0], size


def threshold(values: FloatArray, powers: FloatArray, needed: float, falling: bool) -> float:
    """Value of a shape from which on a law's power is what is needed, as a power law between those that were tried.

    From the smallest on, or from the largest where laws are `falling`, as springs and limits are; where the law would
    be seen even there, that end; NaN where it is seen at none.
    """
    order = np.argsort(values)
    x, y = np.log(values[order]), np.log(powers[order])
    if falling:
        x, y = x[::-1], y[::-1]
    enough = np.flatnonzero(y >= np.log(needed))
    if not len(enough):
        return float("nan")
    at = int(enough[0])
    if at == 0:
        return float(np.exp(x[0]))
    share = (np.log(needed) - y[at - 1]) / (y[at] - y[at - 1])
    return float(np.exp(x[at - 1] + share * (x[at] - x[at - 1])))
