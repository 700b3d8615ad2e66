"""How laws lie in memory for the loops: nothing is compiled anew for another set of them.

Robots of one structure have the same laws at the same places; arguments and places may differ in their numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.compiled.laws import Entries, Kind, entries_of
from robid_core.compiled.memory import in_lanes
from robid_core.mechanics.mechanical_model import MechanicalModel, motors_last
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.terms import CHANNELS, ForceTerm, SignalTerm


class TermArrays(NamedTuple):
    """Laws that act, as data: structure, and numbers as `in_lanes` lays them."""

    force: IntArray
    """(n_force, 11) entry of the law; n_state, first state, first argument; acts where it sees (implicit); axis of the
    gear whose torque it is part of, or -1; ends of direction, coordinate and load in `column`; axis of the motor that
    it brakes before a rigid gear, or -1."""
    signal: IntArray  # (n_signal, 6) entry of the law; n_state, first state, first argument; axis; channel
    column: IntArray  # (n_entry,)
    value: FloatArray  # (n_entry,)
    argument: FloatArray  # (n_set, n_number): of a law, one after the other; where they differ between lanes, as rows
    # of lanes
    weight: FloatArray  # (n_force,) of the slope in position, as `spring_weights`
    loads: IntArray  # (1,) whether any law asks for a load


def term_arrays(
    models: Sequence[MechanicalModel],
    signals: Sequence[SignalTerm],
    robots: IntArray,
    width: int,
    implicit_step: float,
    weights: Sequence[FloatArray],
) -> tuple[TermArrays, list[Entries]]:
    """Lay the laws of robots of one structure out for the loop.

    The entries must live as long as their addresses are used. `weights` are the `spring_weights` of that step, `robots`
    as of `in_lanes`, `width` is that of the blocks.
    """
    order = motors_last(models[0].mechanism)
    column: list[int] = []
    value: list[FloatArray] = []
    argument: list[FloatArray] = []
    rows: dict[str, list[list[int]]] = {"force": [], "signal": []}
    keep = []
    n_state = n_argument = 0
    gears, rigid = _gears(models[0].mechanism), _before_rigid_gears(models[0].mechanism)
    for terms in [*zip(*(model.forces for model in models), strict=True), *((signal,) for signal in signals)]:
        first: ForceTerm | SignalTerm = terms[0]
        kind: Kind = "force" if isinstance(first, ForceTerm) else "signal"
        given = np.stack([np.asarray(term.arguments, dtype=np.float64) for term in terms])
        differ = robots.shape[1] > 1 and bool((given != given[0]).any())
        entries = entries_of(first.law, kind, first.n_state, first.label, given.shape[1] if differ else None)
        keep.append(entries)
        head = [entries.single if width == 1 else entries.lanes, first.n_state, n_state, n_argument]
        own = given[robots if len(given) > 1 else np.zeros_like(robots)].swapaxes(1, 2)
        argument.append(own.reshape(len(robots), -1) if differ else own[:, :, 0])
        n_argument += argument[-1].shape[1]
        n_state += first.n_state
        if isinstance(first, SignalTerm):
            rows["signal"].append([*head, first.axis, CHANNELS.index(first.channel)])
            continue
        ends = [len(column)]
        for name in ("direction", "coordinate", "load"):
            entry = np.stack([getattr(term, name) for term in terms])
            entry = entry if name == "load" else entry[:, order]
            there = np.flatnonzero(entry.any(axis=0))
            column += there.tolist()
            value += list(entry[:, there].T)
            ends.append(len(column))
        acts_where_it_sees = int(all(np.array_equal(term.direction, term.coordinate) for term in terms))
        gear = int(gears.get(tuple(first.direction.tolist()), -1))
        motor = first.braked_motor(models[0].mechanism.n_axis)
        motor = motor if motor in rigid else -1
        rows["force"].append([*head, acts_where_it_sees, gear, *ends, motor])
    nothing = np.zeros(len(models))
    return TermArrays(
        np.array(rows["force"], dtype=np.int64).reshape(-1, 11),
        np.array(rows["signal"], dtype=np.int64).reshape(-1, 6),
        np.array([*column, 0], dtype=np.int64),
        in_lanes(list(np.stack([*value, nothing], axis=1)), robots),
        np.ascontiguousarray(np.concatenate([*argument, np.zeros((len(robots), 1))], axis=1)),
        in_lanes([_weights(*pair, implicit_step) for pair in zip(models, weights, strict=True)], robots),
        np.array([any(np.any(term.load) for model in models for term in model.forces)], dtype=np.int64),
    ), keep


def _gears(mechanism: Mechanism) -> dict[tuple[float, ...], int]:
    """Axis of each elastic gear by its direction."""
    directions = map(tuple, mechanism.spring_directions.tolist())
    return dict(zip(directions, np.flatnonzero(mechanism.elastic_gear).tolist(), strict=False))


def _before_rigid_gears(mechanism: Mechanism) -> list[int]:
    """Motors whose torque a rigid gear passes on."""
    passed = np.linalg.inv(mechanism.gear).T[~mechanism.elastic_gear]
    found: list[int] = np.flatnonzero(passed.any(axis=0)).tolist()
    return found


def _weights(model: MechanicalModel, weight: FloatArray, implicit_step: float) -> FloatArray:
    """Weights of the laws: a law along a spring has that of the spring, any other that of the midpoint."""
    springs = dict(zip(map(tuple, model.mechanism.spring_directions.tolist()), weight.tolist(), strict=True))
    found = [springs.get(tuple(term.direction.tolist()), implicit_step**2 / 4) for term in model.forces]
    return np.array(found, dtype=np.float64)
