"""Whether configurations agree about a law: it must hold in data that were held out, with one size everywhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from robid_diagnosis.columns import WHOLE
from robid_diagnosis.fitted_projection import projection_without
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.least_gains import LEAST
from robid_diagnosis.projection import Gain, Projection
from robid_diagnosis.search import Hit

NOWHERE_ELSE = 0.99  # of a law's squared torque in one configuration: no other one can say anything of it
DIFFERENT = 0.3  # of a gain: what sizes of its own in each configuration may gain beyond a common one
MODEST = 300.0  # likewise, absolute: what strong laws gain beyond it comes of what is wrong in their shape
CHANCE = 1e-3  # probability of sizes that differ as much


def holds_elsewhere(projection: Projection, hit: Hit, groups: Sequence[Sequence[int]]) -> bool:
    """Whether a law gains in configurations, or experiments, that were held out; true where none could say anything."""
    single = [[i] for i in range(len(projection.folds))]
    if any(projection.held_out(hit.sums, hit.gain, one).sum() >= LEAST / 2 for one in (groups, single)):
        return True
    return projection.concentration(hit.sums, hit.gain, groups) > NOWHERE_ELSE


def differs_between(projection: Projection, hit: Hit, groups: Sequence[Sequence[int]]) -> str:
    """Say by how much the size of a weak law differs between configurations; empty where chance may do that.

    Of laws in proportion to a parameter: others have other sizes wherever their shape is a little off.
    """
    if WHOLE in hit.meaning.names or hit.candidate.springs:
        return ""
    beyond, freedom = projection.disagreement(hit.sums, hit.gain, groups)
    if not _differ(beyond, freedom, hit.gain.total):
        return ""
    return f"its size differs between configurations (chi-square {beyond:.3g} of {freedom} degrees)"


def differs_at_fit(fitted: Fitted, names: Sequence[str], gain: float) -> bool:
    """Whether sizes of a law differ between configurations where the law was fitted, in the noise that this left.

    Of a law that bends the motion a search sees the columns of another motion, with which sizes may differ though the
    law is one. `names`: of its fitted numbers; `gain`: of the fit, in twice the log-likelihood.
    """
    projection, groups, columns = projection_without(fitted, names)
    size = np.zeros(len(names))
    whole = Gain(gain, tuple(range(len(names))), size, size, 1.0)
    beyond, freedom = projection.disagreement(projection.sums(columns), whole, groups)
    return _differ(beyond / max(1.0, fitted.misfit), freedom, gain)


def _differ(beyond: float, freedom: int, gain: float) -> bool:
    """Whether sizes of its own in each configuration gain more than chance, and much of what the law gains."""
    return bool(DIFFERENT * gain < beyond < MODEST and scipy.stats.chi2.sf(beyond, freedom) <= CHANCE)
