"""What each excitation shows of each effect: strength a minute, over that of the worked example's multisine.

Strength is what a law of some size gains of twice the log-likelihood once all that was fitted may move. The size
cancels in the quotient; of laws that are linear in nothing each of the values that a search tries is taken. Told is
the median.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import RobidError
from robid_diagnosis.candidates import Candidate, catalogue
from robid_diagnosis.visible import power_of
from studies.fit_accuracy.tables import Row
from studies.hidden_effects.excitations import EXCITATIONS, NOISES, Seen, seen

REFERENCE = next(iter(EXCITATIONS))


def rows(robot: str, seed: int, told: Sequence[str]) -> Iterator[Row]:
    """Rows of each excitation of `told`, one for each effect and place; those of the reference hold 1."""
    reference = seen(robot, REFERENCE, seed)
    candidates = [one for use in catalogue(NOISES) for one in reference.motion.candidates(use)]
    known = [_strengths(reference, one) for one in candidates]
    for excitation in told:
        other = reference if excitation == REFERENCE else seen(robot, excitation, seed)
        shares: dict[tuple[str, str, str], list[float]] = {}
        for candidate, own in zip(candidates, known, strict=True):
            here = own if other is reference else _strengths(other, candidate)
            quotients = [here.get(name, 0.0) / strength for name, strength in own.items()]
            shares.setdefault(candidate.key, []).extend(quotients)
        for (use, on, side), found in shares.items():
            if found:
                place = {"effect": use, "on": on, "side": side}
                named = {"robot": robot, "excitation": excitation, "seed": str(seed)}
                yield named | place | {"ratio": f"{np.median(found):.4g}"}


def report(told: Sequence[Row]) -> list[str]:
    """One line an effect: the median over axes and seeds for each excitation."""
    excitations = [name for name in EXCITATIONS if any(row["excitation"] == name for row in told)]
    effects = list(dict.fromkeys((row["effect"], row["side"]) for row in told))
    lines = [f"{'strength a minute':44}" + "".join(f"{name:>12}" for name in excitations)]
    for effect, side in effects:
        own = [row for row in told if (row["effect"], row["side"]) == (effect, side)]
        medians = (
            np.median([float(row["ratio"]) for row in own if row["excitation"] == name] or [np.nan])
            for name in excitations
        )
        lines.append(f"{f'{effect} ({side})':44}" + "".join(f"{value:12.3g}" for value in medians))
    return lines


def _strengths(about: Seen, candidate: Candidate) -> dict[str, float]:
    """Strength a minute of a unit of each parameter, of `*` for the law as it is; none where it cannot be seen."""
    try:
        hit = about.search.hit(about.at_place(candidate), {})
    except (RobidError, ArithmeticError, ValueError):
        return {}
    matrix, _ = about.projection.normal(hit.sums)
    power = power_of(candidate, hit.columns, matrix, about.search.blind)
    return {name: value / about.minutes for name, value in power.of.items()}
