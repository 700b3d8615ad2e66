"""Eigenvalues, eigenvectors and functions of small complex matrices, thousands of lines at once.

The work is done by `eigen_kernel`, eight lines at a time; its twin is `numpy.linalg.eig`, which also takes the lines
that the kernel did not bring to an end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.response.division import divide


@dataclass(frozen=True)
class Eigen:
    """``A = V diag(value) V^-1``; value (..., n), vector and inverse (..., n, n).

    `condition` (...,) is the product of the Frobenius norms of V and V^-1, infinite where V is singular: below the
    limit that was asked for, or where not, `inverse` is NaN.
    """

    value: ComplexArray
    vector: ComplexArray
    inverse: ComplexArray
    condition: FloatArray


def eigen(matrices: ComplexArray, condition_limit: float) -> Eigen:
    """Decompose matrices (..., n, n), all finite; lines whose eigenvectors have a larger condition get NaN."""
    from robid_core.estimation.response.eigen_kernel import eigen_lines

    whole = np.require(matrices, np.complex128, ["C", "W"])
    n = whole.shape[-1]
    flat = whole.reshape(-1, n, n)
    value, vector = np.empty(flat.shape[:2], dtype=np.complex128), np.empty_like(flat)
    converged = np.ones(len(flat))
    numbers = (x.view(np.float64).reshape(*x.shape, 2) for x in (flat, value, vector))
    eigen_lines(*numbers, converged)
    rest = np.flatnonzero((converged == 0) | ~np.isfinite(vector).all(axis=(1, 2)))
    if len(rest):
        value[rest], vector[rest] = np.linalg.eig(flat[rest])
    quotient = divide(vector, None, condition_limit, equalise=False)
    shape = whole.shape
    return Eigen(
        value.reshape(shape[:-1]),
        vector.reshape(shape),
        quotient.value.reshape(shape),
        quotient.condition.reshape(shape[:-2]),
    )


def matrix_function(of: Eigen, function: Callable[[ComplexArray], ComplexArray]) -> ComplexArray:
    """``V diag(f(value)) V^-1``."""
    with np.errstate(divide="ignore", invalid="ignore"):  # log 0 of a singular response: NaN comes out
        result: ComplexArray = (of.vector * function(of.value)[..., None, :]) @ of.inverse
    return result
