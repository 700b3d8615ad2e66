"""How numbers lie in memory for compiled loops: arrays at the start of a cache line, robots side by side in lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robid_core.arrays import FloatArray, IntArray


def in_lanes(numbers: Sequence[FloatArray], robots: IntArray) -> FloatArray:
    """Lay numbers of several robots side by side.

    Parameters
    ----------
    numbers
        Of each robot, any shape, the same for all.
    robots
        Whose numbers each set has, shape (n_set, 1), or whose each lane of it has, shape (n_set, LANES).

    Returns
    -------
    Shape (n_set, ...), or (n_set, ..., LANES) at the start of a cache line.
    """
    if robots.shape[1] == 1:
        return np.ascontiguousarray(np.stack(numbers)[robots[:, 0]])
    side_by_side = np.moveaxis(np.stack(numbers)[robots], 1, -1)
    (lanes,) = aligned_arrays(side_by_side.shape)
    lanes[:] = side_by_side
    return lanes


def aligned_arrays(*shapes: tuple[int, ...]) -> list[FloatArray]:
    """Allocate zeros side by side, each at the start of a cache line.

    Where numpy happens to put small arrays makes an inner loop up to 1.6 times slower in one process than in another.
    """
    line = 64 // 8
    sizes = [-(-math.prod(shape) // line) * line for shape in shapes]
    memory = np.zeros(sum(sizes) + line)
    start = -memory.ctypes.data % 64 // 8
    starts = [start + sum(sizes[:i]) for i in range(len(shapes))]
    return [memory[at : at + math.prod(s)].reshape(s) for at, s in zip(starts, shapes, strict=True)]


def padded_rows(matrices: FloatArray) -> tuple[IntArray, FloatArray]:
    """Columns (n_row, width) and values (n_robot, n_row, width) of the entries that are not zero in some matrix.

    Rows are filled up with zeros at column 0; `matrices` has shape (n_robot, n_row, n_column).
    """
    there = (matrices != 0).any(axis=0)
    width = int(there.sum(axis=1).max(initial=1))
    column = np.zeros((len(there), width), dtype=np.int64)
    value = np.zeros((len(matrices), len(there), width))
    for i, row in enumerate(there):
        found = np.flatnonzero(row)
        column[i, : len(found)], value[:, i, : len(found)] = found, matrices[:, i, found]
    return column, value
