"""Laws at rest: the forces that springs of effects exert while nothing moves, and their slopes.

At standstill friction is silent (its force is zero at zero speed, its state zero); what depends on the position stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core.mechanics.chain import FloatArray
from robid_core.mechanics.kernel import kernel
from robid_core.mechanics.lanes import LANES
from robid_core.mechanics.laws import entries_of
from robid_core.mechanics.terms import ForceTerm
from robid_core.mechanics.views import address_of, call_law, view_of

ROW = 6  # numbers that go into a law and come out of it
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

    There dry friction has no slope any more: what remains is viscous, and the dampers of springs.
    """
    n_row, n = position.shape
    total = np.zeros((n_row, n, n))
    for term in forces:
        if np.array_equal(term.direction, term.coordinate):
            place = (position * term.coordinate).sum(axis=1)
            slopes = [law_values(term, place, speed)[2] for speed in (-FAST, FAST)]
            total += np.mean(slopes, axis=0)[:, None, None] * np.outer(term.direction, term.direction)
    return total


def law_values(
    term: ForceTerm, position: FloatArray, velocity: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force of one law and its slopes in position and velocity, under no load, from its first state; (n_row,) each."""
    entries = entries_of(term.law, "force", term.n_state, term.label)
    place = np.zeros((-(-len(position) // LANES), ROW, LANES))
    place[:, 0] = np.resize(position, len(place) * LANES).reshape(len(place), LANES)
    place[:, 1] = velocity
    state = np.zeros((max(term.n_state, 1), LANES))
    arguments = np.concatenate((term.arguments, [0.0]))  # never empty
    call_rows(entries.lanes, place, state, state.copy(), arguments)
    force, stiffness, damping = (place[:, row].reshape(-1)[: len(position)].copy() for row in (3, 4, 5))
    return force, stiffness, damping


@kernel
def call_rows(entry, place, state, next_state, arguments):  # type: ignore[no-untyped-def]
    """Call a law for every block of lanes, with a step of no length."""
    rows = view_of(place.reshape(-1))
    before, after, numbers = view_of(state.reshape(-1)), view_of(next_state.reshape(-1)), view_of(arguments)
    for block in range(place.shape[0]):
        call_law(
            entry, address_of(rows, block * place.shape[1] * place.shape[2]), address_of(before, 0),
            address_of(after, 0), address_of(numbers, 0), 0.0,
        )  # fmt: skip
