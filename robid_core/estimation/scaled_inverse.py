"""Inverse of a positive matrix whose rows have very different units."""

from __future__ import annotations

import numpy as np
import scipy

from robid_core.arrays import FloatArray


def scaled_inverse(matrix: FloatArray) -> FloatArray:
    """Inverse of a symmetric positive matrix, symmetric itself; pseudo-inverse where it is singular, shape (n, n).

    Rows and columns are scaled alike, so that springs, bodies and friction in one matrix lose nothing to one another:
    what rounding leaves of a general inverse of such unequal numbers is no covariance any more.
    """
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scales = np.outer(scale, scale)
    inverse = scipy.linalg.pinvh(matrix / scales) / scales
    result: FloatArray = 0.5 * (inverse + inverse.T)
    return result
