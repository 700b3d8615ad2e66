"""Linear algebra of a rigid fit: few rows with the same products as many equations, axis by axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import FloatArray

DEPENDS = 1e-12  # of the largest singular value: instruments that say nothing of their own


def triangles(columns: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Orthonormal and triangular factor of the columns of each axis, (n_equation, n_axis, n_column)."""
    factors = [np.linalg.qr(columns[:, axis]) for axis in range(columns.shape[1])]
    return [(factor.Q, factor.R) for factor in factors]


def beside(q: FloatArray, r: FloatArray, more: FloatArray) -> FloatArray:
    """Triangular factor of the columns ``q r`` with more beside them, (n_row, n_column + n_more)."""
    along = q.T @ more
    rest = np.linalg.qr(more - q @ along, mode="r")
    result: FloatArray = np.block([[r, along], [np.zeros((len(rest), r.shape[1])), rest]])
    return result


def spanned(columns: FloatArray, weight: FloatArray) -> list[FloatArray]:
    """Orthonormal functions that instruments span, (n_equation, n) of each axis.

    Parameters
    ----------
    columns
        Of the torque, at the motion of the instruments, (n_equation, n_axis, n_column).
    weight
        Of the equations, (n_equation, n_axis).
    """
    found = []
    for axis in range(weight.shape[1]):
        own = columns[:, axis] * weight[:, axis, None]
        length = np.linalg.norm(own, axis=0)
        vectors, values, _ = np.linalg.svd(own[:, length > 0] / length[length > 0], full_matrices=False)
        found.append(vectors[:, values > DEPENDS * values.max(initial=0.0)])
    return found


def marginalised(rows: FloatArray, nuisance: FloatArray) -> FloatArray:
    """Whiten equations by what unknowns beside them, known to a standard deviation, add to their noise of one.

    That noise has the covariance ``I + N N^T``.

    Parameters
    ----------
    rows
        Weighted columns and target, (n_row, n_column).
    nuisance
        N, columns of the other unknowns per standard deviation of each, (n_row, n_other).
    """
    left, values, _ = np.linalg.svd(nuisance, full_matrices=False)
    shrunk = 1 - 1 / np.sqrt(1 + values**2)
    result: FloatArray = rows - (left * shrunk) @ (left.T @ rows)
    return result


def size(basis: Sequence[FloatArray] | None, residual: FloatArray) -> float:
    """Squared size of a weighted residual, (n_equation, n_axis), as far as instruments show it."""
    if basis is None:
        return float((residual**2).sum())
    return float(sum(((own.T @ residual[:, axis]) ** 2).sum() for axis, own in enumerate(basis)))
