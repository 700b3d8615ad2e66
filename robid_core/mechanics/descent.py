"""Rest found by descending the potential energy, where Newton's method does not find it: gaps, corners, soft zones.

Inside a gap a joint has hardly any spring, and where the arm stands above it gravity pushes it out: the tangent
stiffness is not positive there, and Newton's method runs to the unstable point in the middle of the gap or to and fro
between its flanks. Weight and springs have a potential; its gradient is what pulls on the coordinates. Each step goes
downhill: along the Newton direction with the curvature taken positive (Nocedal and Wright 2006, section 3.4), as far as
the slope along the way stays negative, which needs no value of the potential. Its end is a minimum: a stable rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import BoolArray, FloatArray

Pull = Callable[[npt.NDArray[np.int64], FloatArray], tuple[FloatArray, FloatArray]]

MOST_STEPS = 200  # a gap takes 5 to 30
TOLERANCE = 1e-12  # rad (m), times (1 + largest coordinate): a step this short ends the way
REACH = 0.02  # rad (m): longest step, so that no flank is jumped over
FALLEN = 1.5  # rad (m) from where no spring is bent: nothing holds the arm
HALVINGS = 60
FLAT = 0.1  # share of the slope at the start of a step that may be left at its end
NUDGE = 1e-7  # rad (m) off an unstable point
SINGULAR = 1e-12  # of the largest stiffness; below it rounding decides the sign


@dataclass(frozen=True)
class Descent:
    """Where each row came to, and whether it rests there."""

    position: FloatArray
    """Coordinates, shape (n_row, n)."""
    rests: BoolArray
    """Whether nothing pulls there and the stiffness is positive, shape (n_row,)."""
    fallen: BoolArray
    """Whether it went too far for anything to hold it, shape (n_row,)."""
    softest: FloatArray
    """Direction of the least stiffness where it ended, shape (n_row, n)."""
    stiffness: FloatArray
    """Stiffness along it, shape (n_row,)."""


def descend(pull: Pull, start: FloatArray) -> Descent:
    """Go downhill from a start in every row until it rests, has fallen, or the steps are spent.

    Parameters
    ----------
    pull
        Takes row numbers and their coordinates; returns the gradient of the potential energy, N m or N, shape (n_row,
        n), and its symmetric slope (n_row, n, n).
    start
        Coordinates, shape (n_row, n).
    """
    position = start.copy()
    n_row, n = start.shape
    rests, fallen = np.zeros(n_row, dtype=np.bool_), np.zeros(n_row, dtype=np.bool_)
    softest, least = np.zeros((n_row, n)), np.full(n_row, np.nan)
    rows = np.arange(n_row)
    for _ in range(MOST_STEPS):
        gradient, slope = pull(rows, position[rows])
        curvature, axes = np.linalg.eigh(slope)
        softest[rows], least[rows] = axes[:, :, 0], curvature[:, 0]
        floor = np.maximum(SINGULAR * abs(curvature).max(axis=1), np.finfo(float).tiny)
        along = np.einsum("rji,rj->ri", axes, gradient)
        step = -np.einsum("rij,rj->ri", axes, along / np.maximum(abs(curvature), floor[:, None]))
        longest = abs(step).max(axis=1)
        short = longest <= TOLERANCE * (1 + abs(position[rows]).max(axis=1))
        stable = curvature[:, 0] > floor
        rests[rows[short & stable]] = True
        nudged = short & ~stable  # a saddle: leave it along its softest direction
        step[nudged] = NUDGE * axes[nudged, :, 0]
        gone = abs(position[rows] - start[rows]).max(axis=1) > FALLEN
        fallen[rows[gone]] = True
        going = ~(short & stable) & ~gone
        if not going.any():
            break
        rows, step, nudged, longest = rows[going], step[going], nudged[going], longest[going]
        step *= np.minimum(1.0, REACH / np.maximum(longest, NUDGE))[:, None]
        share = np.where(nudged, 1.0, _downhill(pull, rows, position[rows], step))
        position[rows] += share[:, None] * step
    return Descent(position, rests, fallen, softest, least)


def _downhill(pull: Pull, rows: npt.NDArray[np.int64], position: FloatArray, step: FloatArray) -> FloatArray:
    """How far each step goes: to its end where that is still downhill, else to where the slope has vanished."""

    def slope_at(share: FloatArray) -> FloatArray:
        gradient, _ = pull(rows, position + share[:, None] * step)
        slope: FloatArray = np.einsum("ri,ri->r", gradient, step)
        return slope

    low, high = np.zeros(len(rows)), np.ones(len(rows))
    first, at_high = slope_at(low), slope_at(high)
    share = high.copy()
    open_ones = at_high > 0
    at_low = first.copy()
    for _ in range(HALVINGS):
        if not open_ones.any():
            break
        between = low + (high - low) * np.clip(at_low / (at_low - at_high), 0.1, 0.9)
        share = np.where(open_ones, between, share)
        found = slope_at(share)
        below = found <= 0
        low, at_low = np.where(open_ones & below, share, low), np.where(open_ones & below, found, at_low)
        high, at_high = (
            np.where(open_ones & ~below, share, high),
            np.where(open_ones & ~below, found, at_high),
        )
        open_ones &= ~(below & (abs(found) <= FLAT * abs(first)))
    return np.where(open_ones, low, share)
