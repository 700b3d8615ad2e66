"""Compiled: eigenvalues and eigenvectors of small complex matrices, eight lines at once.

Householder reflections to Hessenberg form, QR steps with Wilkinson's shift to the triangular Schur form, and the
eigenvectors of the triangle by substitution (G. H. Golub and C. F. Van Loan, Matrix Computations, sections 7.4 to
7.6). The lanes step together until the last of them has found an eigenvalue; what was found stays under further
steps. Callers and the numpy twin: `estimation.response.eigen`.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import LANES, like, where
from robid_core.compiled.views import lanes_of

EPSILON = 2.220446049250313e-16
TINY = 1e-292
MOST_STEPS = 40  # for one eigenvalue; three are usual


@fused_kernel
def root_of(real, imaginary):  # type: ignore[no-untyped-def]
    """Square root of a complex number with a real part that is not negative."""
    size = math.sqrt(real * real + imaginary * imaginary)
    first = math.sqrt(0.5 * (size + abs(real)))
    safe = where(first > TINY, first, 1.0)
    second = 0.5 * abs(imaginary) / safe
    sign = where(imaginary < 0.0, like(real, -1.0), like(real, 1.0))
    forward = real >= 0.0
    return where(forward, first, second), sign * where(forward, second, first)


@fused_kernel
def to_hessenberg(h, q, v, n):  # type: ignore[no-untyped-def]
    """``h = P^H h P`` with zeros below the first subdiagonal; q becomes P. All (n, n, 2), v (n, 2)."""
    for i in range(n):
        for j in range(n):
            q[i, j, 0] = 1.0 if i == j else 0.0
            q[i, j, 1] = 0.0
    for k in range(n - 2):
        square = like(h[0, 0, 0], 0.0)
        for i in range(k + 1, n):
            v[i, 0], v[i, 1] = h[i, k, 0], h[i, k, 1]
            square = square + v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1]
        length = math.sqrt(square)
        first = math.sqrt(v[k + 1, 0] * v[k + 1, 0] + v[k + 1, 1] * v[k + 1, 1])
        safe = where(first > 0.0, first, 1.0)
        # v = x + exp(i arg x_1) |x| e_1
        v[k + 1, 0] = v[k + 1, 0] + length * where(first > 0.0, v[k + 1, 0] / safe, 1.0)
        v[k + 1, 1] = v[k + 1, 1] + length * where(first > 0.0, v[k + 1, 1] / safe, 0.0)
        twice = square + length * first  # half of |v|^2
        factor = where(twice > TINY, 1.0 / where(twice > TINY, twice, 1.0), 0.0)
        for j in range(n):
            real, imaginary = like(h[0, 0, 0], 0.0), like(h[0, 0, 0], 0.0)
            for i in range(k + 1, n):
                real = real + v[i, 0] * h[i, j, 0] + v[i, 1] * h[i, j, 1]
                imaginary = imaginary + v[i, 0] * h[i, j, 1] - v[i, 1] * h[i, j, 0]
            real, imaginary = real * factor, imaginary * factor
            for i in range(k + 1, n):
                h[i, j, 0] = h[i, j, 0] - real * v[i, 0] + imaginary * v[i, 1]
                h[i, j, 1] = h[i, j, 1] - real * v[i, 1] - imaginary * v[i, 0]
        reflect_columns(h, v, factor, k + 1, n)
        reflect_columns(q, v, factor, k + 1, n)


@fused_kernel
def reflect_columns(a, v, factor, first, n):  # type: ignore[no-untyped-def]
    """``a (I - factor v v^H)`` for a vector v that begins at `first`."""
    for i in range(n):
        real, imaginary = like(a[0, 0, 0], 0.0), like(a[0, 0, 0], 0.0)
        for j in range(first, n):
            real = real + a[i, j, 0] * v[j, 0] - a[i, j, 1] * v[j, 1]
            imaginary = imaginary + a[i, j, 0] * v[j, 1] + a[i, j, 1] * v[j, 0]
        real, imaginary = real * factor, imaginary * factor
        for j in range(first, n):
            a[i, j, 0] = a[i, j, 0] - real * v[j, 0] - imaginary * v[j, 1]
            a[i, j, 1] = a[i, j, 1] - imaginary * v[j, 0] + real * v[j, 1]


@fused_kernel
def shift_of(h, last):  # type: ignore[no-untyped-def]
    """Eigenvalue of the trailing 2 x 2 block that is nearer to its last entry."""
    a, b = h[last - 1, last - 1, 0], h[last - 1, last - 1, 1]
    d, e = h[last, last, 0], h[last, last, 1]
    half, half_i = 0.5 * (a - d), 0.5 * (b - e)
    x, y = h[last - 1, last, 0], h[last - 1, last, 1]
    z, w = h[last, last - 1, 0], h[last, last - 1, 1]
    product, product_i = x * z - y * w, x * w + y * z
    root, root_i = root_of(half * half - half_i * half_i + product, 2.0 * half * half_i + product_i)
    # s = d - product / (half +- root), the sign that makes the denominator large
    sign = where(half * root + half_i * root_i < 0.0, like(half, -1.0), like(half, 1.0))
    below, below_i = half + sign * root, half_i + sign * root_i
    square = below * below + below_i * below_i
    safe = where(square > TINY, square, 1.0)
    real, imaginary = (
        (product * below + product_i * below_i) / safe,
        (product_i * below - product * below_i) / safe,
    )
    return d - where(square > TINY, real, 0.0), e - where(square > TINY, imaginary, 0.0)


@fused_kernel
def qr_step(h, q, turn, last, n):  # type: ignore[no-untyped-def]
    """One shifted QR step on rows and columns 0 to `last`, the rest of h and q taken along; turn (n, 4)."""
    shift, shift_i = shift_of(h, last)
    for k in range(last + 1):
        h[k, k, 0] = h[k, k, 0] - shift
        h[k, k, 1] = h[k, k, 1] - shift_i
    for k in range(last):
        a, b = h[k, k, 0], h[k, k, 1]
        c, d = h[k + 1, k, 0], h[k + 1, k, 1]
        square = a * a + b * b + c * c + d * d
        usable = square > TINY
        inverse = 1.0 / math.sqrt(where(usable, square, 1.0))
        a, b = where(usable, a * inverse, 1.0), where(usable, b * inverse, 0.0)
        c, d = where(usable, c * inverse, 0.0), where(usable, d * inverse, 0.0)
        turn[k, 0], turn[k, 1], turn[k, 2], turn[k, 3] = a, b, c, d
        for j in range(k, n):
            x, y = h[k, j, 0], h[k, j, 1]
            z, w = h[k + 1, j, 0], h[k + 1, j, 1]
            h[k, j, 0] = a * x + b * y + c * z + d * w
            h[k, j, 1] = a * y - b * x + c * w - d * z
            h[k + 1, j, 0] = a * z - b * w - c * x + d * y
            h[k + 1, j, 1] = a * w + b * z - c * y - d * x
    for k in range(last):
        a, b, c, d = turn[k, 0], turn[k, 1], turn[k, 2], turn[k, 3]
        turn_columns(h, k, k + 2, a, b, c, d)
        turn_columns(q, k, n, a, b, c, d)
    for k in range(last + 1):
        h[k, k, 0] = h[k, k, 0] + shift
        h[k, k, 1] = h[k, k, 1] + shift_i


@fused_kernel
def turn_columns(h, k, n_row, a, b, c, d):  # type: ignore[no-untyped-def]
    """Columns k and k + 1 of the first rows times the adjoint of a rotation of rows."""
    for i in range(n_row):
        x, y = h[i, k, 0], h[i, k, 1]
        z, w = h[i, k + 1, 0], h[i, k + 1, 1]
        h[i, k, 0] = a * x - b * y + c * z - d * w
        h[i, k, 1] = a * y + b * x + c * w + d * z
        h[i, k + 1, 0] = a * z + b * w - c * x - d * y
        h[i, k + 1, 1] = a * w - b * z - c * y + d * x


@fused_kernel
def vectors_of_triangle(h, x, n):  # type: ignore[no-untyped-def]
    """Eigenvectors of an upper triangle as the columns of the upper triangle x, ones on its diagonal."""
    norm = like(h[0, 0, 0], 0.0)
    for i in range(n):
        for j in range(i, n):
            norm = max(norm, abs(h[i, j, 0]) + abs(h[i, j, 1]))
    smallest = norm * EPSILON + TINY
    for j in range(n):
        x[j, j, 0] = 1.0
        x[j, j, 1] = 0.0
        for above in range(j):
            i = j - 1 - above
            real, imaginary = h[i, j, 0], h[i, j, 1]
            for k in range(i + 1, j):
                real = real + h[i, k, 0] * x[k, j, 0] - h[i, k, 1] * x[k, j, 1]
                imaginary = imaginary + h[i, k, 0] * x[k, j, 1] + h[i, k, 1] * x[k, j, 0]
            below, below_i = h[j, j, 0] - h[i, i, 0], h[j, j, 1] - h[i, i, 1]
            # Equal eigenvalues: a tiny difference, so that the vectors come out dependent and are known by that.
            close = abs(below) + abs(below_i) < smallest
            below, below_i = where(close, smallest, below), where(close, 0.0, below_i)
            square = below * below + below_i * below_i
            x[i, j, 0] = (real * below + imaginary * below_i) / square
            x[i, j, 1] = (imaginary * below - real * below_i) / square


@fused_kernel
def eigen_lines(matrices, value, vector, converged):  # type: ignore[no-untyped-def]
    """Eigenvalues (n_line, n, 2) and unit eigenvectors as columns (n_line, n, n, 2) of (n_line, n, n, 2).

    `converged` (n_line,) is 1 where all eigenvalues were found, else 0.
    """
    n_line, n = matrices.shape[0], matrices.shape[1]
    memory_h, memory_q = np.zeros((n, n, 2, LANES)), np.zeros((n, n, 2, LANES))
    memory_x, memory_v = np.zeros((n, n, 2, LANES)), np.zeros((n, 2, LANES))
    memory_turn, memory_rest = np.zeros((n, 4, LANES)), np.zeros((1, LANES))
    h, q, x, v = lanes_of(memory_h), lanes_of(memory_q), lanes_of(memory_x), lanes_of(memory_v)
    turn, rest = lanes_of(memory_turn), lanes_of(memory_rest)
    found = np.ones(LANES)
    for first in range(0, n_line, LANES):
        for lane in range(LANES):
            line = min(first + lane, n_line - 1)
            found[lane] = 1.0
            for i in range(n):
                for j in range(n):
                    memory_h[i, j, 0, lane] = matrices[line, i, j, 0]
                    memory_h[i, j, 1, lane] = matrices[line, i, j, 1]
        to_hessenberg(h, q, v, n)
        for above in range(n - 1):
            last = n - 1 - above
            for step in range(MOST_STEPS + 1):
                size = abs(h[last, last, 0]) + abs(h[last, last, 1])
                size = size + abs(h[last - 1, last - 1, 0]) + abs(h[last - 1, last - 1, 1])
                beside = abs(h[last, last - 1, 0]) + abs(h[last, last - 1, 1])
                rest[0] = where(beside <= EPSILON * size + TINY, like(size, 0.0), like(size, 1.0))
                open_lanes = 0
                for lane in range(LANES):
                    if memory_rest[0, lane] > 0.0:
                        open_lanes += 1
                if open_lanes == 0:
                    break
                if step == MOST_STEPS:
                    for lane in range(LANES):
                        if memory_rest[0, lane] > 0.0:
                            found[lane] = 0.0
                    break
                qr_step(h, q, turn, last, n)
            h[last, last - 1, 0] = 0.0
            h[last, last - 1, 1] = 0.0
        vectors_of_triangle(h, x, n)
        for j in range(n):
            square = like(h[0, 0, 0], 0.0)
            for i in range(n):
                real, imaginary = like(h[0, 0, 0], 0.0), like(h[0, 0, 0], 0.0)
                for k in range(j + 1):
                    real = real + q[i, k, 0] * x[k, j, 0] - q[i, k, 1] * x[k, j, 1]
                    imaginary = imaginary + q[i, k, 0] * x[k, j, 1] + q[i, k, 1] * x[k, j, 0]
                v[i, 0], v[i, 1] = real, imaginary
                square = square + real * real + imaginary * imaginary
            inverse = 1.0 / math.sqrt(square)
            for i in range(n):
                v[i, 0], v[i, 1] = v[i, 0] * inverse, v[i, 1] * inverse
            for lane in range(min(LANES, n_line - first)):
                line = first + lane
                converged[line] = found[lane]
                value[line, j, 0], value[line, j, 1] = memory_h[j, j, 0, lane], memory_h[j, j, 1, lane]
                for i in range(n):
                    vector[line, i, j, 0] = memory_v[i, 0, lane]
                    vector[line, i, j, 1] = memory_v[i, 1, lane]
