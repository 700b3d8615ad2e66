"""Essential parameters: base parameters that a record tells, found by leaving out one after another.

Base parameters are all that motion could show; a record shows some of them badly. The one with the largest relative
standard error goes, the rest is estimated anew, until what is left of the torque grows by more than chance: an F test
of all that were left out, together (Pham and Gautier 1991; Janot, Vandanjon and Gautier 2014).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray, IntArray
from robid_core.estimation.scaled_inverse import scaled_inverse

LEVEL = 0.05  # probability by chance below which an increase is one


@dataclass(frozen=True, eq=False)
class Elimination:
    """Result of a backward elimination of columns."""

    kept: IntArray
    """Columns, in their order, (n_kept,)."""
    estimate: FloatArray
    standard_error: FloatArray
    removed: IntArray
    """Columns, the first one to go first, (n_removed,)."""
    relative_error: FloatArray
    """Standard error over size of each when it went."""
    increase: FloatArray
    """By which share what is left of the torque, rms, is larger than with all columns."""
    probability: FloatArray
    """Of so much by chance, if all that went so far were zero."""


def eliminate(rows: FloatArray, target: FloatArray, freedom: float, level: float = LEVEL) -> Elimination:
    """Leave out columns as long as an F test does not object.

    Parameters
    ----------
    rows, target
        Weighted to unit long-run variance, (n_row, n_column) and (n_row,).
    freedom
        Independent residuals: fewer than rows where these are coloured.
    level
        Of the test.
    """
    gram, right = rows.T @ rows, rows.T @ target
    count = len(right)
    if count == 0:
        none, no = np.empty(0), np.empty(0, dtype=np.int64)
        return Elimination(no, none, none, no, none, none, none)

    def solved(kept: list[int]) -> tuple[FloatArray, FloatArray, float]:
        inverse = scaled_inverse(gram[np.ix_(kept, kept)])
        found = inverse @ right[kept]
        return found, np.diag(inverse), float(((target - rows[:, kept] @ found) ** 2).sum())

    kept, steps = list(range(count)), list[tuple[int, float, float, float]]()
    found, spread, least = solved(kept)
    freed = max(freedom - count, 1.0)
    variance = max(least / freed, 1e-300)
    while len(kept) > 1:
        relative = np.sqrt(variance * spread) / np.maximum(np.abs(found), 1e-300)
        worst = int(np.argmax(relative))
        rest = kept[:worst] + kept[worst + 1 :]
        moved = solved(rest)
        more = max(moved[2] - least, 0.0)
        n_removed = len(steps) + 1
        chance = float(scipy.stats.f.sf(more / n_removed / variance, n_removed, freed))
        if chance < level:
            break
        grown = float(np.sqrt(1 + more / max(least, 1e-300))) - 1
        steps.append((kept[worst], float(relative[worst]), grown, chance))
        kept, (found, spread, _) = rest, moved
    removed = np.array([step[0] for step in steps], dtype=np.int64)
    told = np.array([step[1:] for step in steps]).reshape(-1, 3)
    return Elimination(np.array(kept, dtype=np.int64), found, np.sqrt(variance * spread), removed, *told.T)
