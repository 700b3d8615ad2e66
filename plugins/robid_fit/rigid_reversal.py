"""Friction where a motor turns back, in a rigid fit: the speed within which its level changes sign.

Coulomb friction is ``coulomb tanh(v / v_s)``. The torque is not linear in v_s, which is found with everything else by
Gauss-Newton steps; the first value is the best of a grid, each axis for itself, with bodies of any kind.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray

GRID = np.linspace(-2.5, 2.5, 11)
"""Logarithms of the factors on a robot file's speed that are tried: 0.08 to 12."""
BETTER = 0.99  # of what is left: no other first value without that


def best_of_grid(torque: FloatArray, others: FloatArray, directions: FloatArray) -> int:
    """Return which of some functions of the speed explains most of a torque, beside any sum of other columns.

    Parameters
    ----------
    torque
        Of one axis, (n_equation,).
    others
        Orthonormal, (n_equation, n_other).
    directions
        Candidates, (n_equation, n_candidate); the one in the middle is taken unless another is clearly better.
    """
    left = torque - others @ (others.T @ torque)
    own = directions - others @ (others.T @ directions)
    size = np.maximum((own**2).sum(axis=0), 1e-300)
    remains = np.maximum(left @ left - np.maximum(own.T @ left, 0.0) ** 2 / size, 0.0)
    middle, best = len(remains) // 2, int(np.argmin(remains))
    return best if remains[best] < BETTER * remains[middle] else middle
