"""Sums of products over parts of the rows of a least-squares problem: enough to fit with or without any part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from robid_core import FloatArray

SAME = 1e-6  # of the largest eigenvalue: columns that depend on one another


@dataclass(frozen=True, eq=False)
class Sums:
    """Products of what a fit has, Q, of columns C, and of a residual y; of each fold, or summed over some of them."""

    shares: FloatArray
    """Q^T Q, (..., n_unknown, n_unknown)."""
    told: FloatArray
    """Q^T y, (..., n_unknown)."""
    cross: FloatArray
    """Q^T C, (..., n_unknown, n_column)."""
    own: FloatArray
    """C^T C, (..., n_column, n_column)."""
    slope: FloatArray
    """C^T y, (..., n_column)."""

    def of_columns(self, chosen: Sequence[int]) -> Sums:
        """Return those of some columns."""
        c = list(chosen)
        return Sums(
            self.shares, self.told, self.cross[..., c], self.own[..., c, :][..., c], self.slope[..., c]
        )

    def over(self, folds: Sequence[int]) -> Sums:
        """Return the sums over some folds."""
        return self._each(lambda values: values[list(folds)].sum(axis=0))

    def less(self, part: Sums) -> Sums:
        """Return the sums over all other rows."""
        return Sums(*(getattr(self, f.name) - getattr(part, f.name) for f in fields(self)))

    def solved(self, pull: FloatArray | float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Unknowns of the fit, and sizes of the columns, these with a pull to zero (n_column,)."""
        n = len(self.told)
        own = self.own + np.diag(np.broadcast_to(pull, self.slope.shape))
        both = np.block([[self.shares, self.cross], [self.cross.T, own]])
        found = solved(both, np.concatenate((self.told, self.slope)))
        return found[:n], found[n:]

    def left(self, unknown: FloatArray, size: FloatArray) -> float:
        """Squared residual less that of no change at all."""
        linear = float(unknown @ self.told + size @ self.slope)
        square = unknown @ self.shares @ unknown + 2 * unknown @ self.cross @ size + size @ self.own @ size
        return float(square) - 2 * linear

    def _each(self, change: Any) -> Sums:
        return Sums(*(change(getattr(self, entry.name)) for entry in fields(self)))


def solved(matrix: FloatArray, slope: FloatArray) -> FloatArray:
    """Solve normal equations; what depends on the rest gets nothing."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    result: FloatArray = inverse(matrix / np.outer(scale, scale)) @ (slope / scale) / scale
    return result


def inverse(matrix: FloatArray, same: float = SAME) -> FloatArray:
    """Inverse of a symmetric matrix, zero along what depends on the rest; most have one number."""
    if matrix.size == 1:
        return np.divide(1.0, matrix, out=np.zeros_like(matrix), where=matrix != 0)
    return np.asarray(np.linalg.pinv(matrix, rcond=same, hermitian=True), dtype=np.float64)
