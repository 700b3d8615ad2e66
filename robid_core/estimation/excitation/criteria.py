"""How well a motion tells the parameters of a linear regression: three criteria of one Gram matrix.

M = W^T W / n, W the regressor with rows over the noise of their axis and columns over fixed scales. Condition
number after Gautier and Khalil (1992), log det M (D-optimal) after Swevers et al. (1997), the ratio of Hadamard's
inequality, det M over the product of its diagonal, after Jin and Gans (2015). Each has a gradient, so that a search
with derivatives can use it.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from robid_core.arrays import FloatArray

Criterion = Literal["condition", "log_det", "hadamard"]

SMALLEST = 1e-15  # eigenvalues below this share of the largest are rounding: the matrix counts as singular


def condition_number(gram: FloatArray) -> float:
    """Condition number of the regressor: the square root of that of its Gram matrix; infinite where it is singular."""
    eigenvalue = np.linalg.eigvalsh(gram)
    if eigenvalue[0] <= SMALLEST * eigenvalue[-1]:
        return float("inf")
    return float(np.sqrt(eigenvalue[-1] / eigenvalue[0]))


def log_determinant(gram: FloatArray) -> float:
    """Natural logarithm of det M, by way of columns of unit length; minus infinity where M is singular."""
    length = np.sqrt(np.diag(gram))
    if not (length > 0).all():
        return -float("inf")
    eigenvalue = np.linalg.eigvalsh(gram / np.outer(length, length))
    if eigenvalue[0] <= SMALLEST * eigenvalue[-1]:
        return -float("inf")
    return float(np.log(eigenvalue).sum() + 2 * np.log(length).sum())


def hadamard_ratio(gram: FloatArray) -> float:
    """det M over the product of its diagonal: 1 for orthogonal columns, 0 for dependent ones, whatever their units.

    Between 0 and 1 by Hadamard's inequality; with fifty columns it is tiny, and its logarithm is what to look at.
    """
    logarithm = log_determinant(gram)
    if not np.isfinite(logarithm):
        return 0.0
    return float(np.exp(min(logarithm - np.log(np.diag(gram)).sum(), 0.0)))


def cost(gram: FloatArray, criterion: Criterion, sharpness: float | None = None) -> tuple[float, FloatArray]:
    """What a search makes small, and its derivative with respect to the Gram matrix.

    The logarithm of the condition number, minus log det, or minus the logarithm of Hadamard's ratio. Eigenvalues at
    the level of rounding count as that level, so that a singular start has a finite cost and a way down.

    Parameters
    ----------
    gram
        M, symmetric, shape (n_parameter, n_parameter).
    criterion
        Which.
    sharpness
        The condition number alone has kinks wherever two eigenvalues meet, and a search for its minimum leads right
        there. With a sharpness b it is smooth, ``(mean l^b mean l^-b)^(1 / 2 b)`` over the eigenvalues l, and grows
        towards the true one with b; the other criteria are smooth as they are.

    Returns
    -------
    (value, slope), slope symmetric with ``d value = trace(slope dM)``.
    """
    # A column without any length has that of rounding beside the longest one.
    length = np.sqrt(np.maximum(np.diag(gram), 1e-30 * np.diag(gram).max()))
    scale = length if criterion == "hadamard" else np.ones_like(length)
    eigenvalue, vector = np.linalg.eigh(gram / np.outer(scale, scale))
    eigenvalue = np.maximum(eigenvalue, SMALLEST * eigenvalue[-1])
    if criterion == "condition":
        if sharpness is None:
            value = 0.5 * float(np.log(eigenvalue[-1] / eigenvalue[0]))
            ends = vector[:, [0, -1]]
            return value, (ends * [-0.5 / eigenvalue[0], 0.5 / eigenvalue[-1]]) @ ends.T
        large = (eigenvalue / eigenvalue[-1]) ** sharpness
        small = (eigenvalue[0] / eigenvalue) ** sharpness
        value = 0.5 * float(np.log(eigenvalue[-1] / eigenvalue[0]))
        value += 0.5 / sharpness * float(np.log(large.mean()) + np.log(small.mean()))
        weight = 0.5 * (large / large.sum() - small / small.sum()) / eigenvalue
        return value, (vector * weight) @ vector.T
    slope = -((vector / eigenvalue) @ vector.T) / np.outer(scale, scale)
    if criterion == "hadamard":
        slope += np.diag(1.0 / length**2)
    return -float(np.log(eigenvalue).sum()), slope
