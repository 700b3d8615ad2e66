"""Kernel of the local rational method where normal equations break: orthogonalisation of a window's rows.

Modified Gram-Schmidt on [K Y] together, which is as stable for least squares as Householder's (A. Bjorck and
C. C. Paige, 1992). A column that is a linear combination of those before it, to rounding, is left out: without
noise the denominator is often not unique, and G does not depend on it.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import LANES, like
from robid_core.compiled.views import lanes_of

DEPENDENT = 1e-13
"""Part of a column, relative to it, below which it counts as dependent; times the square root of the rows."""


@fused_kernel
def columns_of_window(
    data_re: Any, data_im: Any, power: Any, kind: Any, order: Any, sign: Any, column_re: Any, column_im: Any
) -> None:
    """Columns of K and Y; data (m, n_exp, blocks, LANES), columns (n_column, n_exp, blocks, LANES)."""
    z_re, z_im, t = lanes_of(data_re), lanes_of(data_im), lanes_of(power)
    to_re, to_im = lanes_of(column_re), lanes_of(column_im)
    n_column, n_exp, n_block = column_re.shape[:3]
    for c in range(n_column):
        a, scale = kind[c], sign[c]
        for e in range(n_exp):
            for block in range(n_block):
                to_re[c, e, block] = scale * t[order[c], block] * z_re[a, e, block]
                to_im[c, e, block] = scale * t[order[c], block] * z_im[a, e, block]


@fused_kernel
def orthogonalise(
    column_re: Any,
    column_im: Any,
    n_unknown: int,
    r_re: Any,
    r_im: Any,
    inverse: Any,
    lane_re: Any,
    lane_im: Any,
) -> None:
    """Factor R and transformed right-hand sides (n_unknown, columns) of columns (n_column, blocks, LANES), in place.

    What is left of the columns beyond the unknowns are the residuals. `inverse` (n_unknown,) is one over the diagonal
    of R, zero for dependent columns. `lane_re` and `lane_im` (1, LANES) are room.
    """
    x_re, x_im = lanes_of(column_re), lanes_of(column_im)
    sum_re, sum_im = lanes_of(lane_re), lanes_of(lane_im)
    n_column, n_block = column_re.shape[:2]
    floor = DEPENDENT * sqrt(float(n_block * LANES))
    for j in range(n_unknown):
        total = like(x_re[0, 0], 0.0)
        for block in range(n_block):
            total += x_re[j, block] * x_re[j, block] + x_im[j, block] * x_im[j, block]
        sum_re[0] = total
        inverse[j] = 0.0
        for lane in range(LANES):
            inverse[j] += lane_re[0, lane]
    for j in range(n_unknown):
        total = like(x_re[0, 0], 0.0)
        for block in range(n_block):
            total += x_re[j, block] * x_re[j, block] + x_im[j, block] * x_im[j, block]
        sum_re[0] = total
        square = 0.0
        for lane in range(LANES):
            square += lane_re[0, lane]
        usable = square > floor * floor * inverse[j]
        scale = 1.0 / sqrt(square) if usable else 0.0
        inverse[j] = scale
        r_re[j, j] = sqrt(square)
        r_im[j, j] = 0.0
        for block in range(n_block):
            x_re[j, block] = scale * x_re[j, block]
            x_im[j, block] = scale * x_im[j, block]
        for c in range(j + 1, n_column):
            total_re = like(x_re[0, 0], 0.0)
            total_im = total_re
            if usable:
                for block in range(n_block):
                    total_re += x_re[j, block] * x_re[c, block] + x_im[j, block] * x_im[c, block]
                    total_im += x_re[j, block] * x_im[c, block] - x_im[j, block] * x_re[c, block]
            sum_re[0] = total_re
            sum_im[0] = total_im
            re, im = 0.0, 0.0
            for lane in range(LANES):
                re += lane_re[0, lane]
                im += lane_im[0, lane]
            r_re[j, c] = re
            r_im[j, c] = im
            if usable:
                for block in range(n_block):
                    x_re[c, block] = x_re[c, block] - re * x_re[j, block] + im * x_im[j, block]
                    x_im[c, block] = x_im[c, block] - re * x_im[j, block] - im * x_re[j, block]
