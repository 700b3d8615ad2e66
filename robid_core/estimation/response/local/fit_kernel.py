"""Kernel of the local rational method: line after line, by the cheapest way that is accurate there.

Moments and a Cholesky factor where these are accurate enough, by an estimate of their rounding errors; refined
by the rows' residuals where not; rows orthogonalised where the pivots are small.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import LANES
from robid_core.estimation.response.local.normal_equations import (
    assemble,
    back_substitute,
    factor,
    filled,
    forward_substitute,
    rounding_of_first,
    window_moments,
    zeros,
)
from robid_core.estimation.response.local.orthogonal import columns_of_window, orthogonalise
from robid_core.estimation.response.local.residuals import apply, gather, products, transposed

PIVOT = 1e-10
"""Smallest pivot, relative, for normal equations: a correction leaves about 1e-16 / 1e-10 of an error."""
ROUNDING = 5e-11
"""Estimated rounding error of G, relative, up to which it is not refined."""
RESIDUAL = 1e-9
"""Residual power relative to the output's, below which it is taken from the rows: differences lose as many digits."""
CORRECTED = 1e-10
"""A correction of G below this, relative, is the last."""
CORRECTIONS = 4


@fused_kernel
def take_right(r_re: Any, r_im: Any, now_re: Any, now_im: Any, n_out: int) -> None:
    """Transformed right-hand sides, which stand right of R, into (n_unknown, columns filled up)."""
    n_unknown = len(now_re)
    for i in range(n_unknown):
        for k in range(n_out):
            now_re[i, k] = r_re[i, n_unknown + k]
            now_im[i, k] = r_im[i, n_unknown + k]


@fused_kernel
def accurate(r_re: Any, now_re: Any, now_im: Any, way_re: Any, way_im: Any, size: Any, n_in: int) -> bool:
    """Whether normal equations are good enough for G and residuals; `size` are squares of the columns of [K Y]."""
    n_unknown = len(now_re)
    for k in range(n_unknown, len(size)):
        if not r_re[k, k] > RESIDUAL * size[k]:
            return False
    return rounding_of_first(now_re, now_im, way_re, way_im, size[:n_unknown], n_in) < ROUNDING  # type: ignore[no-any-return]


@fused_kernel
def inverse_columns(r_re: Any, r_im: Any, inverse: Any, way_re: Any, way_im: Any) -> None:
    """First columns of ``(R^H R)^-1``, (n_unknown, blocks, LANES), as many as there is room for."""
    way_re[:] = 0.0
    way_im[:] = 0.0
    flat = way_re.reshape(len(way_re), -1)
    for j in range(min(flat.shape)):
        flat[j, j] = 1.0
    forward_substitute(r_re, r_im, inverse, way_re, way_im)
    back_substitute(r_re, r_im, inverse, way_re, way_im)


@fused_kernel
def copy_rows(given: Any, target: Any) -> None:
    """Copy (rows, n_exp, blocks, LANES) number by number: an assignment compiles a message about shapes, too."""
    for i in range(len(target)):
        for e in range(target.shape[1]):
            for b in range(target.shape[2]):
                for lane in range(target.shape[3]):
                    target[i, e, b, lane] = given[i, e, b, lane]


@fused_kernel
def smallest_of(values: Any, count: int) -> Any:
    """Smallest of the first numbers; NaN where one of them is."""
    smallest = values[0]
    for i in range(count):
        if np.isnan(values[i]):
            return values[i]
        smallest = min(smallest, values[i])
    return smallest


@fused_kernel
def store(
    theta_r: Any,
    theta_i: Any,
    way_r: Any,
    way_i: Any,
    ratios: Any,
    n_numerator: int,
    count: int,
    line: int,
    theta: Any,
    gram: Any,
    ratio: Any,
    corrections: Any,
) -> None:
    """Put a line's solution where it belongs."""
    n_unknown, n_out = theta.shape[1:3]
    for i in range(n_unknown):
        for k in range(n_out):
            theta[line, i, k, 0] = theta_r[i, k]
            theta[line, i, k, 1] = theta_i[i, k]
    n_in = gram.shape[1]
    for i in range(n_in):
        for k in range(n_in):
            gram[line, i, k, 0] = way_r[i, k]
            gram[line, i, k, 1] = way_i[i, k]
    ratio[line] = smallest_of(ratios, n_numerator)
    corrections[line] = count


@fused_kernel
def spread_errors(
    data_re: Any,
    data_im: Any,
    power: Any,
    by_line: Any,
    n_line: int,
    place: Any,
    by_kind: Any,
    r_re: Any,
    r_im: Any,
    inverse: Any,
    way_r: Any,
    way_i: Any,
    n_in: int,
    weight_re: Any,
    weight_im: Any,
    lane_re: Any,
    lane_im: Any,
    row_re: Any,
    row_im: Any,
    influence: Any,
    free: Any,
) -> None:
    """Moments of the errors' way to G and of what the fit leaves of each line; see `kernel.LineFits`.

    `row_re` and `row_im` (n_unknown, n_exp, blocks, LANES) are room.
    """
    n_unknown, n_exp = row_re.shape[:2]
    n_moment = len(power)
    apply(
        data_re,
        data_im,
        power,
        place,
        by_kind,
        way_r,
        way_i,
        -1,
        weight_re,
        weight_im,
        row_re[:n_in],
        row_im[:n_in],
    )
    for s in range(n_moment):
        products(row_re[:n_in], row_im[:n_in], power[s], lane_re, lane_im, influence[s])
    for s in range(n_moment):
        for i in range(n_in):
            for k in range(n_in):
                influence[s, i, k, 1] = -influence[s, i, k, 1]  # a = conj(K (K^H K)^-1)
    own_re, own_im = zeros((n_unknown, filled(n_unknown), LANES))
    own_r, own_i = own_re.reshape(n_unknown, -1), own_im.reshape(n_unknown, -1)
    for i in range(n_unknown):
        own_r[i, i] = 1.0
    back_substitute(r_re, r_im, inverse, own_re, own_im)
    apply(
        data_re, data_im, power, place, by_kind, own_r, own_i, -1, weight_re, weight_im, row_re, row_im
    )  # rows of K R^-1 are orthonormal: their squares are leverages
    flat_re, flat_im = row_re.reshape(n_unknown, n_exp, -1), row_im.reshape(n_unknown, n_exp, -1)
    free[:] = 0.0
    for r in range(n_line):
        leverage = 0.0
        for i in range(n_unknown):
            for e in range(n_exp):
                leverage += flat_re[i, e, r] ** 2 + flat_im[i, e, r] ** 2
        for s in range(n_moment):
            free[s] += by_line[r, s] * (n_exp - leverage)


@fused_kernel
def fit_lines(
    start: int,
    stop: int,
    frequency: Any,
    first: Any,
    last: Any,
    half_width: Any,
    plane_re: Any,
    plane_im: Any,
    product_re: Any,
    product_im: Any,
    entry: Any,
    entry_sign: Any,
    place: Any,
    kind: Any,
    order: Any,
    sign: Any,
    n_in: int,
    n_unknown: int,
    n_numerator: int,
    with_influence: bool,
    largest: int,
    theta: Any,
    square: Any,
    gram: Any,
    influence: Any,
    free: Any,
    ratio: Any,
    corrections: Any,
) -> None:
    """Fit lines `start` to `stop`; arrays as in `kernel.LineFits` and `kernel.solve_lines`, the results' real and
    imaginary parts along a last axis."""
    m, n_exp = plane_re.shape[:2]
    n_column, n_out, n_power = len(kind), len(kind) - n_unknown, place.shape[1]
    n_block, n_moment = filled(largest), 2 * n_power - 1
    data_re, data_im = zeros((m, n_exp, n_block, LANES))
    sum_re, sum_im = zeros((n_moment, product_re.shape[1], LANES))
    gram_re, gram_im = zeros((n_column, filled(n_column), LANES))
    r_re, r_im = gram_re.reshape(n_column, -1), gram_im.reshape(n_column, -1)
    now_re, now_im = zeros((n_unknown, filled(n_out), LANES))
    theta_r, theta_i = now_re.reshape(n_unknown, -1), now_im.reshape(n_unknown, -1)
    step_re, step_im = zeros((n_unknown, filled(n_out), LANES))
    step_r, step_i = step_re.reshape(n_unknown, -1), step_im.reshape(n_unknown, -1)
    way_re, way_im = zeros((n_unknown, filled(n_in), LANES))
    way_r, way_i = way_re.reshape(n_unknown, -1), way_im.reshape(n_unknown, -1)
    row_re, row_im = zeros((n_out, n_exp, n_block, LANES))
    column_re, column_im = zeros((n_column, n_exp, n_block, LANES))
    lane_re, lane_im = zeros((n_block + 1, LANES))
    weight_re, weight_im = zeros((m, LANES))
    by_kind = np.ones(m)
    for k in range(n_in, m):
        by_kind[k] = -1.0
    power = np.zeros((n_moment, n_block, LANES))
    by_line, by_power = np.zeros((largest, n_moment)), power.reshape(n_moment, -1)
    inverse, ratios, size = np.zeros(n_unknown), np.zeros(n_unknown), np.zeros(n_column)
    for line in range(start, stop):
        n_line, begin = last[line] - first[line] + 1, first[line]
        for r in range(n_line):
            t, value = (frequency[begin + r] - frequency[line]) / half_width[line], 1.0
            for s in range(n_moment):
                by_line[r, s] = value
                value *= t
        window_moments(product_re, product_im, by_line, begin, n_line, sum_re, sum_im)
        assemble(
            sum_re.reshape(-1),
            sum_im.reshape(-1),
            entry,
            entry_sign,
            gram_re.reshape(-1),
            gram_im.reshape(-1),
        )
        for k in range(n_column):
            size[k] = r_re[k, k]
        factor(gram_re, gram_im, n_unknown, inverse, ratios)
        smallest, count = smallest_of(ratios, n_unknown), 0
        if smallest > PIVOT:
            take_right(r_re, r_im, theta_r, theta_i, n_out)
            back_substitute(r_re, r_im, inverse, now_re, now_im)
            inverse_columns(r_re, r_im, inverse, way_re, way_im)
            if not with_influence and accurate(r_re, theta_r, theta_i, way_r, way_i, size, n_in):
                for i in range(n_out):
                    for k in range(i, n_out):
                        re, im = r_re[n_unknown + i, n_unknown + k], r_im[n_unknown + i, n_unknown + k]
                        square[line, i, k, 0] = re
                        square[line, i, k, 1] = -im
                        square[line, k, i, 0] = re
                        square[line, k, i, 1] = im
                store(
                    theta_r, theta_i, way_r, way_i, ratios, n_numerator, count, line, theta, gram, ratio, corrections
                )  # fmt: skip
                continue
        by_power[:] = 0.0
        for r in range(n_line):
            for s in range(n_moment):
                by_power[s, r] = by_line[r, s]
        gather(
            plane_re, plane_im, begin, n_line, data_re.reshape(m, n_exp, -1), data_im.reshape(m, n_exp, -1)
        )
        while smallest > PIVOT:
            apply(
                data_re,
                data_im,
                power,
                place,
                by_kind,
                theta_r,
                theta_i,
                n_in,
                weight_re,
                weight_im,
                row_re,
                row_im,
            )
            transposed(
                data_re, data_im, power, place, by_kind, row_re, row_im, lane_re, lane_im, step_r, step_i
            )
            forward_substitute(r_re, r_im, inverse, step_re, step_im)
            back_substitute(r_re, r_im, inverse, step_re, step_im)
            largest_g, change = 0.0, 0.0
            for i in range(n_unknown):
                for k in range(n_out):
                    theta_r[i, k] += step_r[i, k]
                    theta_i[i, k] += step_i[i, k]
                    if i < n_in:
                        change = max(change, step_r[i, k] ** 2 + step_i[i, k] ** 2)
                        largest_g = max(largest_g, theta_r[i, k] ** 2 + theta_i[i, k] ** 2)
            count += 1
            if change <= CORRECTED**2 * largest_g:
                break
            if count == CORRECTIONS:
                smallest = 0.0
        if not smallest > PIVOT:
            count = -1
            columns_of_window(data_re, data_im, power, kind, order, sign, column_re, column_im)
            orthogonalise(
                column_re.reshape(n_column, -1, LANES), column_im.reshape(n_column, -1, LANES),
                n_unknown, r_re, r_im, inverse, lane_re, lane_im,
            )  # fmt: skip
            take_right(r_re, r_im, theta_r, theta_i, n_out)
            back_substitute(r_re, r_im, inverse, now_re, now_im)
            inverse_columns(r_re, r_im, inverse, way_re, way_im)
            copy_rows(column_re[n_unknown:], row_re)
            copy_rows(column_im[n_unknown:], row_im)
            for j in range(n_unknown):
                diagonal = 0.0
                for i in range(j + 1):
                    diagonal += r_re[i, j] ** 2 + r_im[i, j] ** 2
                ratios[j] = r_re[j, j] ** 2 / diagonal if diagonal > 0.0 else 0.0
        products(row_re, row_im, power[0], lane_re, lane_im, square[line])
        store(
            theta_r, theta_i, way_r, way_i, ratios, n_numerator, count, line, theta, gram, ratio, corrections
        )
        if with_influence:
            spread_errors(
                data_re, data_im, power, by_line, n_line, place, by_kind, r_re, r_im, inverse, way_r, way_i, n_in,
                weight_re, weight_im, lane_re, lane_im, column_re[:n_unknown], column_im[:n_unknown],
                influence[line], free[line],
            )  # fmt: skip
