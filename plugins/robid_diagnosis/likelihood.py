"""Fits compared by twice their log-likelihood, in the weights of one of them.

A fit leaves out experiments in which its own robot rattles. What is compared are the experiments that either fit uses:
one that a fit leaves out counts for it as the mean of its others. So nothing becomes needless because the experiments
that show it are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid_core import BoolArray
from robid_core.residual import Linearisation
from robid_diagnosis.hypothesis import Fitted


def costs(one: Fitted, other: Fitted, about: Linearisation) -> tuple[float, float]:
    """Return twice the negative log-likelihood of two fits, and their priors, in the weights of a third or of one."""
    used = [_either(a.used, b.used) for a, b in zip(one.problem.blocks, other.problem.blocks, strict=True)]
    return _cost(one, about, used), _cost(other, about, used)


def lost(one: Fitted, other: Fitted, about: Linearisation) -> float:
    """By how much twice the log-likelihood of a fit is smaller than that of another."""
    mine, its = costs(one, other, about)
    return mine - its


def is_nearer(one: Fitted, other: Fitted, without: Fitted) -> bool:
    """Whether a fit of a law is nearer to all experiments than another one, in the weights of the fit without the law.

    A fit explains nothing of experiments that it leaves out: they count as without the law.
    """
    every = tuple(replace(weight, used=None) for weight in without.about.weights)
    bare = without.problem.weighted(without.point, every)

    def cost(fitted: Fitted) -> float:
        weighted = fitted.problem.weighted(fitted.point, every)
        for own, known, block in zip(weighted, bare, fitted.problem.blocks, strict=True):
            if block.used is not None:
                own[~block.used] = known[~block.used]
        return fitted.problem.cost(fitted.point, weighted)

    return cost(one) < cost(other)


def _either(one: BoolArray | None, other: BoolArray | None) -> BoolArray | None:
    """Experiments that either uses, (n_config, n_exp); None: all."""
    return None if one is None or other is None else one | other


def _cost(fitted: Fitted, about: Linearisation, used: Sequence[BoolArray | None]) -> float:
    weights = tuple(replace(weight, used=mask) for weight, mask in zip(about.weights, used, strict=True))
    weighted = fitted.problem.weighted(fitted.point, weights)
    for own, mask, block in zip(weighted, used, fitted.problem.blocks, strict=True):
        if block.used is not None:
            counted = np.ones_like(block.used) if mask is None else mask
            own[~block.used] = 0.0
            own *= np.sqrt(counted.sum() / max(1, (counted & block.used).sum()))
    return 2 * fitted.problem.cost(fitted.point, weighted)
