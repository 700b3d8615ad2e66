"""Doubt of a fit whose experiments do not tell the same parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import Doubt
from robid_core.estimation.disagreement import Disagreement

FALSE_ALARM = 0.01  # of a fit whose experiments are alike, at most
DISAGREE = 1.5  # times what residuals explain: less is no matter
MOST = 6  # names in a sentence


def disagreement_doubt(found: Disagreement, names: Sequence[str], n_experiment: int) -> Iterator[Doubt]:
    """Doubt numbers that experiments disagree on, those that are furthest apart first; `names` are theirs."""
    apart = np.flatnonzero((found.p_value < FALSE_ALARM) & (found.ratio > DISAGREE))
    if not len(apart):
        return
    worst = apart[np.argsort(-found.ratio[apart])]
    told = ", ".join(f"{names[i]} {found.ratio[i]:.2g} times" for i in worst[:MOST].tolist())
    more = f" and {len(worst) - MOST} more" if len(worst) > MOST else ""
    yield Doubt(
        "experiments disagree",
        f"the fits without each of the {n_experiment} experiments differ by more than their residuals explain "
        f"(chance {found.p_value[apart].min():.1g}): {told}{more}",
        "do not rely on the stated errors: experiments differ in what the model lacks (temperature, load, speed)",
    )
