"""Which entries an elimination touches: the sparse structure of a bordered symmetric matrix, once for all its values.

For ``[[Z, E^T], [E, 0]]`` with E the places between which the transfer is wanted (`condensation`). Order of the
coordinates: motors behind springs first, each touches few others; then coordinates that no motor touches, then those
that one does, so that what comes from the motors enters late; last motors on rigid gears, for they touch all. Within
these from the tip of the chain to its base: branches of a tree stay apart (R. Featherstone, Rigid Body Dynamics
Algorithms, 2008, section 6.5).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from robid_core.arrays import BoolArray, FloatArray, IntArray


class Plan(NamedTuple):
    """Entries of the bordered lower triangle that are ever nonzero, column by column in the order of elimination.

    Columns are the n coordinates, then the border rows of the n_axis motors; results stand in the latter.
    """

    row: IntArray  # (n_entry,) coordinate, or n + row of the border
    column: IntArray  # (n_entry,) likewise
    start: IntArray  # (n + n_axis + 1,) first entry of each column, its diagonal
    stop: IntArray  # (n,) end of those entries of a column whose rows are columns too
    target: IntArray  # for each such entry, and each from it to its column's end: the entry that their product changes
    motor: IntArray  # (n_axis (n_axis + 1) / 2,) results between motors, a lower triangle
    source: IntArray  # where results stand: response, spring vectors, motor vectors, row by row


def plan_of(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, border: FloatArray, n_axis: int
) -> Plan:
    """List the work of `condense` for matrices (n_config, n, n) and a border (n_axis + n_spring, n), motors first."""
    coupled = (mass != 0).any(axis=0)
    touched = coupled | (damping != 0).any(axis=0) | (stiffness != 0).any(axis=0)
    return _plan(n_axis, len(touched), coupled.tobytes(), touched.tobytes(), (border != 0).tobytes())


@lru_cache(maxsize=64)
def _plan(n_axis: int, n: int, *patterns: bytes) -> Plan:
    coupled, touched, border = (np.frombuffer(pattern, np.bool_).reshape(-1, n) for pattern in patterns)
    order = _order(coupled, touched, n_axis)
    columns = _filled_columns(touched[np.ix_(order, order)], border[:, order], n_axis)
    pairs = [(i, j) for j, rows in enumerate(columns) for i in rows]
    entry = {pair: e for e, pair in enumerate(pairs)}
    stop, target = [], []
    for j, rows in enumerate(columns[:n]):
        pivots = [i for i in rows[1:] if i < n + n_axis]
        stop.append(entry[j, j] + 1 + len(pivots))
        target += [entry[i, pivot] for f, pivot in enumerate(pivots, start=1) for i in rows[f:]]
    motor = [entry[n + i, n + j] for i in range(n_axis) for j in range(i + 1)]
    result = [entry[n + max(i, m), n + min(i, m)] for i in range(len(border)) for m in range(n_axis)]
    motors, springs = result[: n_axis * n_axis], result[n_axis * n_axis :]
    response = [len(pairs) + motor.index(e) for e in motors]
    place = [*order.tolist(), *range(n, n + len(border))]
    lists: tuple[list[int], ...] = (
        [place[i] for i, _ in pairs],
        [place[j] for _, j in pairs],
        np.cumsum([0, *map(len, columns)]).tolist(),
        stop,
        target,
        motor,
        response + springs + motors,
    )
    return Plan(*(np.array(numbers, dtype=np.int64) for numbers in lists))


def _order(coupled: BoolArray, touched: BoolArray, n_axis: int) -> IntArray:
    motor = np.arange(len(touched)) < n_axis
    rigid = coupled[:, ~motor].any(axis=1)
    group = np.where(motor, np.where(rigid, 3, 0), np.where(touched[:, motor].any(axis=1), 2, 1))
    order: IntArray = np.lexsort((-np.arange(len(touched)), group))
    return order


def _filled_columns(touched: BoolArray, border: BoolArray, n_axis: int) -> list[list[int]]:
    """Rows of each column of the bordered lower triangle that elimination touches, its diagonal first."""
    n, n_row = len(touched), len(touched) + len(border)
    nonzero = np.concatenate((touched, border))
    for k in range(n):  # eliminating one coordinate couples all that it touches
        nonzero[k, k] = True
        hit = np.flatnonzero(nonzero[k:, k]) + k
        nonzero[np.ix_(hit, hit[hit < n])] = True
    columns = [(np.flatnonzero(nonzero[k:, k]) + k).tolist() for k in range(n)]
    return columns + [list(range(n + motor, n_row)) for motor in range(n_axis)]
