"""Which effects are taken for which: what is left of a law once another one, at its best, may stand in its place.

Of a law of strength 1000 the share that the other cannot do is what tells the two apart; below 9 (three standard
deviations) they are confused. The rival is tried with every value that a search tries, the law with its middle one; of
a law with several sizes that counts which the rival does worst.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import FloatArray, RobidError
from robid_diagnosis.candidates import catalogue
from robid_diagnosis.sums import solved
from studies.fit_accuracy.tables import Row
from studies.hidden_effects.excitations import EXCITATIONS, NOISES, seen

STRENGTH = 1000.0
TOLD_APART = 9.0
WRITTEN = 0.1  # of the law: what leaves more is far from being confused
ROUNDING = 1e-3  # of a strength


def rows(robot: str, seed: int, told: Sequence[str]) -> Iterator[Row]:
    """Rows of each excitation of `told`: a law, a rival, and the share of the law that the rival leaves."""
    for excitation in told:
        about = seen(robot, excitation, seed)
        columns: dict[str, list[FloatArray]] = {}
        for use in catalogue(NOISES):
            for candidate in about.motion.candidates(use):
                try:
                    found = about.motion.columns(candidate).rows
                except (RobidError, ArithmeticError, ValueError):
                    continue
                if np.isfinite(found).all() and found.any():
                    columns.setdefault(" ".join(candidate.key), []).append(found)
        for law, rival, share in _shares(about.projection.fitted, columns, about.search.blind):
            if share < WRITTEN:
                named = {"robot": robot, "excitation": excitation, "seed": str(seed)}
                yield named | {"law": law, "rival": rival, "left": f"{share:.3g}"}


def _shares(
    fitted: FloatArray, columns: dict[str, list[FloatArray]], blind: float
) -> Iterator[tuple[str, str, float]]:
    """Law, rival, and the least share of the law's strength that the rival leaves with any of its values.

    Parameters
    ----------
    fitted
        Orthonormal with the priors: what the fit has, (n_row, n_unknown).
    columns
        Of each candidate of each law, (n_column, n_row).
    blind
        Share of a column's square: of a law of which less is left beside the fit nothing is said.
    """
    left = {law: [one - (one @ fitted) @ fitted.T for one in own] for law, own in columns.items()}
    for law, own in left.items():
        wholes = columns[law][len(own) // 2]
        parts = []
        for true, whole in zip(own[len(own) // 2], wholes, strict=True):
            strength = float(true @ whole)  # by the priors more than its own square
            if strength > blind * float(whole @ whole):
                parts.append((true, strength))
        if not parts:
            continue
        for rival, others in left.items():
            if rival == law:
                continue
            shares = []
            for one, whole in zip(others, columns[rival], strict=True):
                matrix = whole @ one.T
                shares.append(
                    max(
                        1 - float((whole @ true) @ solved(matrix, whole @ true)) / strength
                        for true, strength in parts
                    )
                )
            yield law, rival, max(min(shares), 0.0)


def report(told: Sequence[Row]) -> list[str]:
    """Pairs that some excitation confuses, and what is left of a law of strength 1000 under each."""
    excitations = [name for name in EXCITATIONS if any(row["excitation"] == name for row in told)]
    shares: dict[tuple[str, str], dict[str, list[float]]] = {}
    for row in told:
        pair = shares.setdefault((row["law"], row["rival"]), {})
        pair.setdefault(row["excitation"], []).append(STRENGTH * float(row["left"]))
    confused = {
        pair: own
        for pair, own in shares.items()
        if any(np.median(values) < TOLD_APART for values in own.values())
    }
    lines = [f"{'law':46}{'taken for':46}" + "".join(f"{name:>12}" for name in excitations)]
    for (law, rival), own in sorted(confused.items()):
        medians = (float(np.median(own[name])) if name in own else np.nan for name in excitations)
        lines.append(f"{law:46}{rival:46}" + "".join(_cell(value) for value in medians))
    return lines


def _cell(value: float) -> str:
    """A strength; shares that were not written are larger, and rounding is nothing."""
    text = f"> {STRENGTH * WRITTEN:.0f}" if np.isnan(value) else f"{value:.2g}" if value > ROUNDING else "0"
    return f"{text:>12}"
