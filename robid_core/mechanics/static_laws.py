"""Laws at rest: the forces that springs of effects exert while nothing moves, and their slopes.

At standstill friction is silent (its force is zero at zero speed, its state zero); what depends on the position stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.mechanics.law_along import law_along
from robid_core.mechanics.terms import ForceTerm

FAST = 1e3  # rad/s: dry friction has long reached its level, no bristle sticks


@dataclass(frozen=True)
class StaticForce:
    """What laws exert on the generalised coordinates at rest; leading axis: rows of the position."""

    force: FloatArray
    """To be added to ``K z``, shape (n_row, n_coordinate)."""
    stiffness: FloatArray
    """Its slope, shape (n_row, n_coordinate, n_coordinate); of laws that act where they see."""


def static_force(forces: Sequence[ForceTerm], position: FloatArray) -> StaticForce:
    """Forces and slopes of laws at generalised coordinates of shape (n_row, n_coordinate)."""
    n_row, n = position.shape
    total, slope = np.zeros((n_row, n)), np.zeros((n_row, n, n))
    for term in forces:
        force, stiffness, _ = law_values(term, (position * term.coordinate).sum(axis=1), 0.0)
        total += force[:, None] * term.direction
        if np.array_equal(term.direction, term.coordinate):
            slope += stiffness[:, None, None] * np.outer(term.direction, term.direction)
    return StaticForce(total, slope)


def viscous_damping(forces: Sequence[ForceTerm], position: FloatArray) -> FloatArray:
    """Damping matrix that is left of laws at high speed, shape (n_row, n_coordinate, n_coordinate).

    There dry friction has no slope any more: what remains is viscous, and the dampers of springs. Of a slope that grows
    with the speed (drag) what stands at none counts.
    """
    n_row, n = position.shape
    total = np.zeros((n_row, n, n))
    for term in forces:
        if np.array_equal(term.direction, term.coordinate):
            place = (position * term.coordinate).sum(axis=1)
            half, whole = (
                np.mean([law_values(term, place, way * speed)[2] for way in (-1, 1)], axis=0)
                for speed in (0.5 * FAST, FAST)
            )
            slope = np.maximum(2 * half - whole, 0.0)
            total += slope[:, None, None] * np.outer(term.direction, term.direction)
    return total


def law_values(
    term: ForceTerm, position: FloatArray, velocity: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force of one law and its slopes in position and velocity, under no load, from its first state; (n_row,) each."""
    run = law_along(term, position[:, None], np.full((len(position), 1), velocity), 0.0, 0.0)
    return run.force[:, 0], run.slope_position[:, 0], run.slope_velocity[:, 0]
