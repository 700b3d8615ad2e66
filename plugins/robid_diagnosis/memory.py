"""Free functions with memory: what a force that depends on the way since its reversals can be.

Elastic sliders side by side, each a spring that slips at a displacement of its own, approximate any force that does
not depend on the rate (Prandtl 1928; Iwan 1966, Journal of Applied Mechanics 33): Dahl's, hysteresis of a gear, a
contact that sticks. With thresholds given they are linear in their levels.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray

STRIDE = (
    4  # points of the finer grid in one step of the sliders: a sample, within which hardly anything reverses
)
ROUNDS = 2  # of motions that repeat: after the first all sliders have slipped, or never do


def sliders(position: FloatArray, thresholds: FloatArray, *, repeats: bool) -> FloatArray:
    """Displacement of elastic sliders, in units of their thresholds.

    Parameters
    ----------
    position
        In rad or m, (n_lane, n_time).
    thresholds
        Displacements at which they slip, (n_slider,).
    repeats
        Whether the motion is a period: sliders are then as they were one period ago, else they begin relaxed.

    Returns
    -------
    Between -1 and 1, (n_slider, n_lane, n_time).
    """
    coarse, limit = position[:, ::STRIDE], thresholds[:, None]
    moved = np.diff(coarse, axis=1, append=coarse[:, :1]).T
    state = np.zeros((len(thresholds), len(position)))
    reached = np.empty((len(moved), *state.shape))
    for _ in range(ROUNDS if repeats else 1):
        for now, step in enumerate(moved):
            reached[now] = state
            state = np.clip(state + step, -limit, limit)
    begun = np.repeat(np.moveaxis(reached, 0, -1), STRIDE, axis=-1)[..., : position.shape[1]]
    since = position - np.repeat(coarse, STRIDE, axis=1)[:, : position.shape[1]]
    return np.clip(begun + since, -limit[..., None], limit[..., None]) / limit[..., None]
