"""Whether angles are the bare counts of an encoder: the counts of a turn that make torque and motion fit."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from robid_core.estimation.rigid.mended import Mended, mends, shares
from robid_core.estimation.rigid.plausibility import TIE, Recorded, Slip

POWERS = tuple(2**bits for bits in range(7, 25))
TURNS = (*POWERS, *(first * power for power in (10, 100, 1000) for first in (10, 20, 36, 40, 50, 80)))
UNITS = (1.0, 180 / np.pi)  # that a map takes counts for: radians, degrees


def bare_counts_in(recorded: Recorded, axes: Sequence[int]) -> tuple[list[int], Mended] | None:
    """Return the counts of a turn, with which the angles of these axes make a recording fit; None where none do.

    All axes have as many, of those that encoders have (powers of two, and round numbers). Those that explain about as
    much are returned too, powers of two first.

    Parameters
    ----------
    recorded
        What was recorded, below the robot's first resonance.
    axes
        Those whose angles come in steps that are no encoder's.
    """
    before, found, n_axis = shares(recorded), list[tuple[int, Mended]](), recorded.drives.n_axis
    for turn, unit in itertools.product(TURNS, UNITS):
        scale = np.ones(n_axis)
        scale[list(axes)] = unit * 2 * np.pi / turn
        after = shares(recorded.undone(Slip("", "", np.diag(scale), np.eye(n_axis))))
        if mends(before, after):
            found.append((turn, Mended.of_shares(tuple(axes), before, after)))
    if not found:
        return None
    best = max((mended for _, mended in found), key=lambda one: one.explained)
    near = {turn for turn, mended in found if mended.explained > best.explained - TIE}
    return sorted(near, key=lambda turn: (turn not in POWERS, turn)), best
