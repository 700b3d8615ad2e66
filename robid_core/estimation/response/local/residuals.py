"""Kernels of the local rational method: what the rows of a window's equations leave over, and what they contribute.

Rows are not formed: with ``W(t)`` the polynomial matrix of a solution, the residual of line r and experiment e is
``W(t_r)^T z``. A window's data stand as (m, n_exp, blocks, LANES), its lines in the lanes, filled up with zeros.
"""

from __future__ import annotations

from typing import Any

from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import like
from robid_core.compiled.views import lanes_of


@fused_kernel
def gather(plane_re: Any, plane_im: Any, first: int, n_line: int, data_re: Any, data_im: Any) -> None:
    """Copy a window's lines from (m, n_exp, n_freq) to (m, n_exp, lines filled up)."""
    m, n_exp, n_filled = data_re.shape
    for a in range(m):
        for e in range(n_exp):
            for r in range(n_line):
                data_re[a, e, r] = plane_re[a, e, first + r]
                data_im[a, e, r] = plane_im[a, e, first + r]
            for r in range(n_line, n_filled):
                data_re[a, e, r] = 0.0
                data_im[a, e, r] = 0.0


@fused_kernel
def _sum(lane: Any, row: int) -> float:
    """Sum of the lanes of a row, by halves."""
    low = (lane[row, 0] + lane[row, 4]) + (lane[row, 2] + lane[row, 6])
    return low + ((lane[row, 1] + lane[row, 5]) + (lane[row, 3] + lane[row, 7]))  # type: ignore[no-any-return]


@fused_kernel
def apply(
    data_re: Any,
    data_im: Any,
    power: Any,
    place: Any,
    sign: Any,
    theta_re: Any,
    theta_im: Any,
    n_in: int,
    weight_re: Any,
    weight_im: Any,
    row_re: Any,
    row_im: Any,
) -> None:
    """Rows of ``Y - K theta``, or of ``-K theta`` where n_in is negative.

    Parameters
    ----------
    data_re, data_im
        (m, n_exp, blocks, LANES).
    power
        Powers of the offset, zero where lines fill up, (n_power, blocks, LANES).
    place, sign
        Column of K that holds ``sign[a] t^s z_a``, (m, n_power), negative where there is none; and (m,).
    theta_re, theta_im
        (n_unknown, columns filled up).
    n_in
        Where the outputs begin among the data.
    weight_re, weight_im
        Room, (m, LANES).
    row_re, row_im
        Result, (n_column, n_exp, blocks, LANES).
    """
    m, n_exp, n_block = data_re.shape[:3]
    n_column, n_power = row_re.shape[0], place.shape[1]
    z_re, z_im, t = lanes_of(data_re), lanes_of(data_im), lanes_of(power)
    w_re, w_im = lanes_of(weight_re), lanes_of(weight_im)
    to_re, to_im = lanes_of(row_re), lanes_of(row_im)
    for block in range(n_block):
        zero = like(t[0, block], 0.0)
        for column in range(n_column):
            for a in range(m):
                re, im = zero, zero
                if n_in >= 0 and a == n_in + column:
                    re = t[0, block]
                for s in range(n_power):
                    c = place[a, s]
                    if c >= 0:
                        re -= (sign[a] * theta_re[c, column]) * t[s, block]
                        im -= (sign[a] * theta_im[c, column]) * t[s, block]
                w_re[a] = re
                w_im[a] = im
            for e in range(n_exp):
                re, im = zero, zero
                for a in range(m):
                    re += w_re[a] * z_re[a, e, block] - w_im[a] * z_im[a, e, block]
                    im += w_re[a] * z_im[a, e, block] + w_im[a] * z_re[a, e, block]
                to_re[column, e, block] = re
                to_im[column, e, block] = im


@fused_kernel
def transposed(
    data_re: Any,
    data_im: Any,
    power: Any,
    place: Any,
    sign: Any,
    row_re: Any,
    row_im: Any,
    lane_re: Any,
    lane_im: Any,
    theta_re: Any,
    theta_im: Any,
) -> None:
    """``K^H`` times rows (n_column, n_exp, blocks, LANES) into theta (n_unknown, columns filled up).

    `lane_re` and `lane_im` (blocks + 1, LANES) are room; the rest as in `apply`.
    """
    m, n_exp, n_block = data_re.shape[:3]
    n_power, n_column = place.shape[1], row_re.shape[0]
    z_re, z_im, t = lanes_of(data_re), lanes_of(data_im), lanes_of(power)
    e_re, e_im = lanes_of(row_re), lanes_of(row_im)
    q_re, q_im = lanes_of(lane_re), lanes_of(lane_im)
    zero = like(t[0, 0], 0.0)
    for a in range(m):
        for column in range(n_column):
            for block in range(n_block):
                re, im = zero, zero
                for e in range(n_exp):
                    re += (
                        z_re[a, e, block] * e_re[column, e, block]
                        + z_im[a, e, block] * e_im[column, e, block]
                    )
                    im += (
                        z_re[a, e, block] * e_im[column, e, block]
                        - z_im[a, e, block] * e_re[column, e, block]
                    )
                q_re[block] = re
                q_im[block] = im
            for s in range(n_power):
                c = place[a, s]
                if c < 0:
                    continue
                re, im = zero, zero
                for block in range(n_block):
                    re += t[s, block] * q_re[block]
                    im += t[s, block] * q_im[block]
                q_re[n_block] = re
                q_im[n_block] = im
                theta_re[c, column] = sign[a] * _sum(lane_re, n_block)
                theta_im[c, column] = sign[a] * _sum(lane_im, n_block)


@fused_kernel
def products(row_re: Any, row_im: Any, weight: Any, lane_re: Any, lane_im: Any, result: Any) -> None:
    """``sum weight x_i conj(x_k)`` over rows (n_column, n_exp, blocks, LANES); `weight` (blocks, LANES) by line.

    `lane_re` and `lane_im` (at least one row of LANES) are room; the result is (n_column, n_column).
    """
    n_column, n_exp, n_block = row_re.shape[:3]
    x_re, x_im, t = lanes_of(row_re), lanes_of(row_im), lanes_of(weight)
    sum_re, sum_im = lanes_of(lane_re), lanes_of(lane_im)
    for i in range(n_column):
        for k in range(i + 1):
            total_re = like(t[0], 0.0)
            total_im = total_re
            for block in range(n_block):
                re = like(t[0], 0.0)
                im = re
                for e in range(n_exp):
                    re += x_re[i, e, block] * x_re[k, e, block] + x_im[i, e, block] * x_im[k, e, block]
                    im += x_im[i, e, block] * x_re[k, e, block] - x_re[i, e, block] * x_im[k, e, block]
                total_re += t[block] * re
                total_im += t[block] * im
            sum_re[0] = total_re
            sum_im[0] = total_im
            re_sum, im_sum = _sum(lane_re, 0), _sum(lane_im, 0)
            result[i, k, 0] = re_sum
            result[i, k, 1] = im_sum
            result[k, i, 0] = re_sum
            result[k, i, 1] = -im_sum
