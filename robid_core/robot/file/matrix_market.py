"""Matrix Market files (R. F. Boisvert, R. Pozo, K. A. Remington, NISTIR 5935, 1996), read without trust.

`scipy.io.mmread` (1.17) ends the process on a coordinate file that is cut short; this reader counts first.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse


def read_matrix_market(path: Path) -> Any:
    """Read a real matrix: an array from `array`, a scipy.sparse.csr_array from `coordinate`.

    Parameters
    ----------
    path
        A file with the header ``%%MatrixMarket matrix coordinate|array real|integer general|symmetric``.

    Raises
    ------
    ValueError
        For another header, a number of entries that is not the one announced, or an index outside the matrix.
    """
    header, _, rest = path.read_text(encoding="ascii").partition("\n")
    words = header.lower().split()
    if len(words) != 5 or words[:2] != ["%%matrixmarket", "matrix"]:
        raise ValueError("its first line is no Matrix Market header")
    layout, kind, symmetry = words[2:]
    if (
        layout not in ("array", "coordinate")
        or kind not in ("real", "integer")
        or symmetry not in ("general", "symmetric")
    ):
        raise ValueError(f"a '{layout} {kind} {symmetry}' matrix; write a real one, general or symmetric")
    lines = [line for line in rest.splitlines() if line.strip() and not line.startswith("%")]
    if not lines:
        raise ValueError("the line with the size is missing")
    size = [int(word) for word in lines[0].split()]
    if len(size) != (2 if layout == "array" else 3) or min(size) < 0:
        raise ValueError(f"'{lines[0].strip()}' is no size of a matrix '{layout}'")
    numbers = np.array(" ".join(lines[1:]).split(), dtype=np.float64)
    n_row, n_column = size[:2]
    if symmetry == "symmetric" and n_row != n_column:
        raise ValueError(f"a symmetric matrix of {n_row} rows and {n_column} columns")
    if layout == "array":
        return _array(numbers, n_row, n_column, symmetry == "symmetric")
    _count(len(numbers), 3 * size[2])
    entries = numbers.reshape(-1, 3)
    row, column = entries[:, :2].T.astype(np.int64) - 1
    if len(row) and (min(row.min(), column.min()) < 0 or row.max() >= n_row or column.max() >= n_column):
        raise ValueError(f"an index outside {n_row} x {n_column}")
    value = entries[:, 2]
    if symmetry == "symmetric":
        below = row != column
        row, column = np.r_[row, column[below]], np.r_[column, row[below]]
        value = np.r_[value, value[below]]
    return scipy.sparse.coo_array((value, (row, column)), shape=(n_row, n_column)).tocsr()


def _array(numbers: Any, n_row: int, n_column: int, symmetric: bool) -> Any:
    """Fill a dense matrix column by column; of a symmetric one the lower triangle is there."""
    if not symmetric:
        _count(len(numbers), n_row * n_column)
        return numbers.reshape(n_column, n_row).T.copy()
    _count(len(numbers), n_row * (n_row + 1) // 2)
    matrix = np.zeros((n_row, n_row))
    column, row = np.triu_indices(n_row)  # rows of the upper triangle are columns of the lower one
    matrix[row, column] = matrix[column, row] = numbers
    return matrix


def _count(found: int, announced: int) -> None:
    if found != announced:
        raise ValueError(f"{found} numbers where its size announces {announced}")
