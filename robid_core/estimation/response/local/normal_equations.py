"""Kernels of the local rational method: the normal equations of a window by moments, and their solution.

With z = [u; y] the entries of ``K^H K`` are moments ``sum_r t_r^s conj(z_a) z_b`` over the window's lines, so
the products of a line are formed once and serve all windows it belongs to. ``K^H K`` squares the condition
number; what that costs is won back by refinement with residuals of the equations themselves (`residuals`;
corrected seminormal equations, A. Bjorck, 1987), and where the pivots say that it cannot be, the window goes
to `orthogonal`.

Real and imaginary parts stand apart; eight neighbours in memory are worked on at once (`mechanics.lanes`).
Last axes of length LANES are lanes, filled up with zeros.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import LANES, like
from robid_core.compiled.views import lanes_of


@fused_kernel
def to_planes(spectra: Any, start: int, plane_re: Any, plane_im: Any) -> None:
    """Spectra (n_freq, n, n_exp, 2), real and imaginary parts last, to planes (m, n_exp, n_freq or more)."""
    n_freq, n, n_exp = spectra.shape[:3]
    for line in range(n_freq):
        for a in range(n):
            for e in range(n_exp):
                plane_re[start + a, e, line] = spectra[line, a, e, 0]
                plane_im[start + a, e, line] = spectra[line, a, e, 1]


@fused_kernel
def line_products(
    plane_re: Any, plane_im: Any, lane_re: Any, lane_im: Any, n_freq: int, product_re: Any, product_im: Any
) -> None:
    """``sum_e conj(z_a) z_b`` for a <= b of each line, eight lines at a time.

    Planes (m, n_exp, blocks, LANES) with the lines in the lanes, filled up; products (n_freq, pairs filled
    up); `lane_re` and `lane_im` (1, LANES) are room.
    """
    m, n_exp, n_block = plane_re.shape[:3]
    z_re, z_im = lanes_of(plane_re), lanes_of(plane_im)
    sum_re, sum_im = lanes_of(lane_re), lanes_of(lane_im)
    for block in range(n_block):
        pair, start = 0, block * LANES
        for a in range(m):
            for b in range(a, m):
                re = like(z_re[0, 0, 0], 0.0)
                im = re
                for e in range(n_exp):
                    x_re, x_im, y_re, y_im = (
                        z_re[a, e, block],
                        z_im[a, e, block],
                        z_re[b, e, block],
                        z_im[b, e, block],
                    )
                    re += x_re * y_re + x_im * y_im
                    im += x_re * y_im - x_im * y_re
                sum_re[0] = re
                sum_im[0] = im
                for lane in range(min(LANES, n_freq - start)):
                    product_re[start + lane, pair] = lane_re[0, lane]
                    product_im[start + lane, pair] = lane_im[0, lane]
                pair += 1


@fused_kernel
def window_moments(
    product_re: Any, product_im: Any, power: Any, first: int, n_line: int, sum_re: Any, sum_im: Any
) -> None:
    """Sum of products over a window times powers of the offset; `power` (n_line, n_moment).

    Products (n_freq, blocks, LANES), sums (n_moment, blocks, LANES), an odd number of moments and an even number of
    blocks: two by two, so that eight sums are under way at once.
    """
    from_re, from_im = lanes_of(product_re), lanes_of(product_im)
    to_re, to_im = lanes_of(sum_re), lanes_of(sum_im)
    n_moment = sum_re.shape[0]
    for block in range(0, sum_re.shape[1], 2):
        for s in range(0, n_moment - 1, 2):
            a_re = like(from_re[first, block], 0.0)
            a_im, b_re, b_im, c_re, c_im, d_re, d_im = a_re, a_re, a_re, a_re, a_re, a_re, a_re
            for r in range(first, first + n_line):
                t, next_t = power[r - first, s], power[r - first, s + 1]
                x_re, x_im, y_re, y_im = (
                    from_re[r, block],
                    from_im[r, block],
                    from_re[r, block + 1],
                    from_im[r, block + 1],
                )
                a_re += t * x_re
                a_im += t * x_im
                b_re += t * y_re
                b_im += t * y_im
                c_re += next_t * x_re
                c_im += next_t * x_im
                d_re += next_t * y_re
                d_im += next_t * y_im
            to_re[s, block] = a_re
            to_im[s, block] = a_im
            to_re[s, block + 1] = b_re
            to_im[s, block + 1] = b_im
            to_re[s + 1, block] = c_re
            to_im[s + 1, block] = c_im
            to_re[s + 1, block + 1] = d_re
            to_im[s + 1, block + 1] = d_im
        a_re = like(from_re[first, block], 0.0)
        a_im, b_re, b_im = a_re, a_re, a_re
        for r in range(first, first + n_line):
            t = power[r - first, n_moment - 1]
            a_re += t * from_re[r, block]
            a_im += t * from_im[r, block]
            b_re += t * from_re[r, block + 1]
            b_im += t * from_im[r, block + 1]
        to_re[n_moment - 1, block] = a_re
        to_im[n_moment - 1, block] = a_im
        to_re[n_moment - 1, block + 1] = b_re
        to_im[n_moment - 1, block + 1] = b_im


@fused_kernel
def assemble(sum_re: Any, sum_im: Any, place: Any, sign: Any, gram_re: Any, gram_im: Any) -> None:
    """Upper triangle of ``[K Y]^H [K Y]`` from moments.

    Entry by entry, `place` (entries, 2) gives where it stands in the gram matrix and where among the sums,
    both flat, and `sign` (entries, 2) those of its real and imaginary part.
    """
    for entry in range(len(place)):
        gram_re[place[entry, 0]] = sign[entry, 0] * sum_re[place[entry, 1]]
        gram_im[place[entry, 0]] = sign[entry, 1] * sum_im[place[entry, 1]]


@fused_kernel
def _pivot(
    re: Any, im: Any, flat_re: Any, flat_im: Any, j: int, n_block: int, inverse: Any, ratio: Any
) -> bool:
    """Divide row j by the root of its pivot; False where there is none."""
    pivot = flat_re[j, j]
    if not pivot > 1e-15 * inverse[j]:
        return False
    ratio[j] = pivot / inverse[j]
    scale = 1.0 / sqrt(pivot)
    inverse[j] = scale
    for block in range(j // LANES, n_block):
        re[j, block] = scale * re[j, block]
        im[j, block] = scale * im[j, block]
    return True


@fused_kernel
def _reduce(re: Any, im: Any, flat_re: Any, flat_im: Any, j: int, i: int, n_block: int) -> None:
    """Take from row i what row j explains."""
    c_re, c_im = flat_re[j, i], flat_im[j, i]
    for block in range(i // LANES, n_block):
        x_re, x_im = re[j, block], im[j, block]
        re[i, block] = re[i, block] - c_re * x_re - c_im * x_im
        im[i, block] = im[i, block] - c_re * x_im + c_im * x_re


@fused_kernel
def factor(gram_re: Any, gram_im: Any, n_unknown: int, inverse: Any, ratio: Any) -> None:
    """Cholesky factor ``R^H R`` of the first columns, in place, with what stands right of them transformed along.

    What becomes of the rows and columns beyond the unknowns are the products ``conj(e_i) e_k`` of the residuals.
    Gram (n_column, blocks, LANES) holds the upper triangle. `inverse` (n_unknown,) gets one over the diagonal of R,
    `ratio` (n_unknown,) each pivot relative to the entry it came from: the square of the sine of the angle between a
    column and those before it. Ends with zeros in it where the matrix is singular in double precision.
    """
    n_column, n_block = gram_re.shape[:2]
    re, im = lanes_of(gram_re), lanes_of(gram_im)
    flat_re, flat_im = gram_re.reshape(n_column, -1), gram_im.reshape(n_column, -1)
    for j in range(n_unknown):
        inverse[j] = flat_re[j, j]
        ratio[j] = 0.0
    for j in range(0, n_unknown, 2):  # two columns at a time: what they act on is fetched once
        if not _pivot(re, im, flat_re, flat_im, j, n_block, inverse, ratio):
            return
        _reduce(re, im, flat_re, flat_im, j, j + 1, n_block)
        if j + 1 == n_unknown:
            for i in range(j + 2, n_column):
                _reduce(re, im, flat_re, flat_im, j, i, n_block)
            return
        if not _pivot(re, im, flat_re, flat_im, j + 1, n_block, inverse, ratio):
            return
        i = j + 2
        while i + 1 < n_column:  # and two rows at a time; i is even, so both begin in the same block
            a_re, a_im, b_re, b_im = flat_re[j, i], flat_im[j, i], flat_re[j + 1, i], flat_im[j + 1, i]
            c_re, c_im, d_re, d_im = (
                flat_re[j, i + 1],
                flat_im[j, i + 1],
                flat_re[j + 1, i + 1],
                flat_im[j + 1, i + 1],
            )
            for block in range(i // LANES, n_block):
                x_re, x_im, y_re, y_im = re[j, block], im[j, block], re[j + 1, block], im[j + 1, block]
                re[i, block] = re[i, block] - a_re * x_re - a_im * x_im - b_re * y_re - b_im * y_im
                im[i, block] = im[i, block] - a_re * x_im + a_im * x_re - b_re * y_im + b_im * y_re
                re[i + 1, block] = re[i + 1, block] - c_re * x_re - c_im * x_im - d_re * y_re - d_im * y_im
                im[i + 1, block] = im[i + 1, block] - c_re * x_im + c_im * x_re - d_re * y_im + d_im * y_re
            i += 2
        for rest in range(i, n_column):
            _reduce(re, im, flat_re, flat_im, j, rest, n_block)
            _reduce(re, im, flat_re, flat_im, j + 1, rest, n_block)


@fused_kernel
def back_substitute(gram_re: Any, gram_im: Any, inverse: Any, theta_re: Any, theta_im: Any) -> None:
    """Solve ``R theta = c`` in place for several right-hand sides; R (n, columns), theta (n, blocks, LANES)."""
    re, im = lanes_of(theta_re), lanes_of(theta_im)
    n_unknown, n_block = theta_re.shape[:2]
    for i in range(n_unknown - 1, -1, -1):
        for block in range(n_block):
            x_re, x_im = re[i, block], im[i, block]
            for j in range(i + 1, n_unknown):
                c_re, c_im = gram_re[i, j], gram_im[i, j]
                x_re += c_im * im[j, block] - c_re * re[j, block]
                x_im -= c_re * im[j, block] + c_im * re[j, block]
            re[i, block] = inverse[i] * x_re
            im[i, block] = inverse[i] * x_im


@fused_kernel
def forward_substitute(gram_re: Any, gram_im: Any, inverse: Any, theta_re: Any, theta_im: Any) -> None:
    """Solve ``R^H x = theta`` in place; shapes as in `back_substitute`."""
    re, im = lanes_of(theta_re), lanes_of(theta_im)
    n_unknown, n_block = theta_re.shape[:2]
    for i in range(n_unknown):
        for block in range(n_block):
            x_re, x_im = inverse[i] * re[i, block], inverse[i] * im[i, block]
            re[i, block] = x_re
            im[i, block] = x_im
            for j in range(i + 1, n_unknown):
                c_re, c_im = gram_re[i, j], gram_im[i, j]
                re[j, block] = re[j, block] - c_re * x_re - c_im * x_im
                im[j, block] = im[j, block] - c_re * x_im + c_im * x_re


@fused_kernel
def rounding_of_first(
    theta_re: Any, theta_im: Any, way_re: Any, way_im: Any, size: Any, n_first: int
) -> float:
    """How far rounding errors in ``K^H K`` reach into the first rows of theta, relative to their largest entry.

    An error in entry (c, d) is about epsilon ``a_c a_d`` with the columns' norms a; independent of each other
    they change row j by ``|H_j a| |a theta|`` epsilon, with H the inverse of ``K^H K`` (in the largest of rows
    and columns). The true error is a few times this at most: `python tests/bench/local_rational.py` compares
    every line with least squares by rows.

    Parameters
    ----------
    theta_re, theta_im
        Solution (n_unknown, columns filled up).
    way_re, way_im
        First columns of the inverse, (n_unknown, columns filled up).
    size
        Diagonal of ``K^H K``, (n_unknown,).
    n_first
        Rows that count.
    """
    n_unknown = len(size)
    way, theta, first = 0.0, 0.0, 0.0
    for j in range(n_first):
        total = 0.0
        for c in range(n_unknown):
            total += size[c] * (way_re[c, j] ** 2 + way_im[c, j] ** 2)
        way = max(way, total)
    for k in range(theta_re.shape[1]):
        total = 0.0
        for c in range(n_unknown):
            square = theta_re[c, k] ** 2 + theta_im[c, k] ** 2
            total += size[c] * square
            if c < n_first:
                first = max(first, square)
        theta = max(theta, total)
    return 2.2e-16 * sqrt(way * theta / first) if first > 0.0 else 1.0


@fused_kernel
def filled(length: int) -> int:
    """Blocks of LANES that hold `length` numbers."""
    return -(-length // LANES)


@fused_kernel
def zeros(shape: Any) -> Any:
    """Room for real and imaginary parts, of any shape."""
    return np.zeros(shape), np.zeros(shape)
