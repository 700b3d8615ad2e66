"""Compiled: division of matrices by matrices, eight lines at once, by Gram-Schmidt orthogonalisation done twice.

``A^H = Q R`` with orthonormal columns of Q and R upper triangular; then ``A^+ = Q R^-H`` and ``(A A^H)^-1 =
R^-1 R^-H``. Orthogonalised twice where it matters, Q is orthonormal to rounding, whatever the condition number
(L. Giraud, J. Langou, M. Rozloznik and J. van den Eshof, 2005), and ``A A^H`` is never formed: that would square it.
Callers and the numpy twins: `estimation.response.division`.

Matrices come as complex numbers in flat float64 arrays, real and imaginary part in turn; item (part, row, column)
of line l stands at ``start[l] + part stride[0] + row stride[1] + column stride[2]`` (counted in complex numbers), and
parts stand side by side: blocks of experiments need not be copied together.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import LANES, like
from robid_core.compiled.views import lanes_of


@fused_kernel
def aligned(n_row, n_column):  # type: ignore[no-untyped-def]
    """Memory (n_row, n_column, 2, LANES) whose lanes begin at multiples of their size: no load crosses a cache line."""
    size = n_row * n_column * 2 * LANES
    buffer = np.zeros(size + LANES)
    skip = (-(buffer.ctypes.data // 8)) % LANES
    return buffer[skip : skip + size].reshape((n_row, n_column, 2, LANES))


@fused_kernel
def gather_lines(flat, start, stride, n_part, n_row, n_column, first, conjugate, memory):  # type: ignore[no-untyped-def]
    """Copy the matrices of eight lines to `memory` (n_row, n_part n_column, 2, LANES); the last line fills up."""
    sign = -1.0 if conjugate else 1.0
    for lane in range(LANES):
        begin = start[min(first + lane, start.shape[0] - 1)]
        for part in range(n_part):
            for i in range(n_row):
                place = 2 * (begin + part * stride[0] + i * stride[1])
                for j in range(n_column):
                    here = place + 2 * j * stride[2]
                    memory[i, part * n_column + j, 0, lane] = flat[here]
                    memory[i, part * n_column + j, 1, lane] = sign * flat[here + 1]


@fused_kernel
def row_products(a, i, b, k, n_column):  # type: ignore[no-untyped-def]
    """Sums over j of real x real, imaginary x imaginary, real x imaginary and imaginary x real of two rows.

    Four sums at once, because each addition has to wait for the one before.
    """
    zero = like(a[0, 0, 0], 0.0)
    rr, ii, ri, ir = zero, zero, zero, zero
    for j in range(n_column):
        rr = rr + a[i, j, 0] * b[k, j, 0]
        ii = ii + a[i, j, 1] * b[k, j, 1]
        ri = ri + a[i, j, 0] * b[k, j, 1]
        ir = ir + a[i, j, 1] * b[k, j, 0]
    return rr, ii, ri, ir


@fused_kernel
def two_row_products(a, i, c, m, b, k, n_column):  # type: ignore[no-untyped-def]
    """Sums as `row_products` gives them of row i of a, and of row m of c, with row k of b: eight at once."""
    zero = like(a[0, 0, 0], 0.0)
    rr, ii, ri, ir = zero, zero, zero, zero
    rr_2, ii_2, ri_2, ir_2 = zero, zero, zero, zero
    for j in range(n_column):
        real, imaginary = b[k, j, 0], b[k, j, 1]
        x, y, z, w = a[i, j, 0], a[i, j, 1], c[m, j, 0], c[m, j, 1]
        rr = rr + x * real
        ii = ii + y * imaginary
        ri = ri + x * imaginary
        ir = ir + y * real
        rr_2 = rr_2 + z * real
        ii_2 = ii_2 + w * imaginary
        ri_2 = ri_2 + z * imaginary
        ir_2 = ir_2 + w * real
    return rr, ii, ri, ir, rr_2, ii_2, ri_2, ir_2


@fused_kernel
def row_square(q, i, n_column):  # type: ignore[no-untyped-def]
    """Square of the length of a row."""
    square = like(q[0, 0, 0], 0.0)
    for j in range(n_column):
        square = square + q[i, j, 0] * q[i, j, 0] + q[i, j, 1] * q[i, j, 1]
    return square


@fused_kernel
def orthogonalise(q, r, n, n_column, memory, scratch):  # type: ignore[no-untyped-def]
    """Rows of `q` (n, n_column, 2) become orthonormal, what they were is ``r^T q`` with the upper triangle of r.

    Below its diagonal r (n, n, 2) keeps notes. A row is freed of its predecessors again where that took more than
    half of its square in some lane (W. Kahan's criterion). `memory` (2, LANES) and its view `scratch` are for that
    question.
    """
    for i in range(n):
        for k in range(i):
            r[k, i, 0] = 0.0
            r[k, i, 1] = 0.0
        scratch[0] = row_square(q, i, n_column)
        again = True
        while again:
            for pair in range((i + 1) // 2):
                k, other = 2 * pair, min(2 * pair + 1, i - 1)
                rr, ii, ri, ir, rr_2, ii_2, ri_2, ir_2 = two_row_products(q, k, q, other, q, i, n_column)
                r[i, k, 0] = rr + ii
                r[i, k, 1] = ri - ir
                r[i, other, 0] = rr_2 + ii_2
                r[i, other, 1] = ri_2 - ir_2
            for k in range(i):
                real, imaginary = r[i, k, 0], r[i, k, 1]
                for j in range(n_column):
                    q[i, j, 0] = q[i, j, 0] - real * q[k, j, 0] + imaginary * q[k, j, 1]
                    q[i, j, 1] = q[i, j, 1] - real * q[k, j, 1] - imaginary * q[k, j, 0]
                r[k, i, 0] = r[k, i, 0] + real
                r[k, i, 1] = r[k, i, 1] + imaginary
            scratch[1] = row_square(q, i, n_column)
            again = False
            for lane in range(LANES):
                if memory[1, lane] < 0.5 * memory[0, lane]:
                    again = True
                memory[0, lane] = 0.0  # twice is enough
        length = math.sqrt(scratch[1])
        r[i, i, 0] = length
        r[i, i, 1] = 0.0
        inverse = 1.0 / length
        for j in range(n_column):
            q[i, j, 0] = q[i, j, 0] * inverse
            q[i, j, 1] = q[i, j, 1] * inverse


@fused_kernel
def invert_triangle(r, t, n):  # type: ignore[no-untyped-def]
    """Inverse t of an upper triangle r with a real diagonal, each (n, n, 2)."""
    for i in range(n):
        t[i, i, 0] = 1.0 / r[i, i, 0]
        t[i, i, 1] = 0.0
        for k in range(i):
            real, imaginary = like(r[0, 0, 0], 0.0), like(r[0, 0, 0], 0.0)
            for m in range(k, i):
                real = real + t[k, m, 0] * r[m, i, 0] - t[k, m, 1] * r[m, i, 1]
                imaginary = imaginary + t[k, m, 0] * r[m, i, 1] + t[k, m, 1] * r[m, i, 0]
            t[k, i, 0] = -real * t[i, i, 0]
            t[k, i, 1] = -imaginary * t[i, i, 0]


@fused_kernel
def times_triangle(w, t, x, n_row, n):  # type: ignore[no-untyped-def]
    """``x = w t^H`` for an upper triangle t (n, n, 2); w and x (n_row, n, 2)."""
    for o in range(n_row):
        for i in range(n):
            real, imaginary = like(w[0, 0, 0], 0.0), like(w[0, 0, 0], 0.0)
            for k in range(i, n):
                real = real + w[o, k, 0] * t[i, k, 0] + w[o, k, 1] * t[i, k, 1]
                imaginary = imaginary + w[o, k, 1] * t[i, k, 0] - w[o, k, 0] * t[i, k, 1]
            x[o, i, 0] = real
            x[o, i, 1] = imaginary


@fused_kernel
def divide_lines(a, a_start, a_stride, b, b_start, b_stride, sizes, x, gram, square):  # type: ignore[no-untyped-def]
    """``x = B A^+`` of every line, or ``A^+`` where B has no rows; ``gram = (A A^H)^-1``.

    `sizes`: parts, rows of A, columns of a part, rows of B. Out: x (n_line, rows of B or columns of A, rows of A, 2),
    gram (n_line, rows of A, rows of A, 2) and the square of each row of A, (n_line, rows of A).
    """
    n_part, n, n_each, m = sizes[0], sizes[1], sizes[2], sizes[3]
    n_column = n_part * n_each
    n_out = m if m > 0 else n_column
    memory_q, memory_r = aligned(n, n_column), aligned(n, n)
    memory_t, memory_b = aligned(n, n), aligned(max(m, 1), n_column)
    memory_w, memory_x = aligned(n_out, n), aligned(n_out, n)
    memory_s, memory_gram = np.empty((n, LANES)), aligned(n, n)
    memory_scratch = np.empty((2, LANES))
    q, r, t, right = lanes_of(memory_q), lanes_of(memory_r), lanes_of(memory_t), lanes_of(memory_b)
    w, out, s, inverse = lanes_of(memory_w), lanes_of(memory_x), lanes_of(memory_s), lanes_of(memory_gram)
    scratch = lanes_of(memory_scratch)
    for first in range(0, a_start.shape[0], LANES):
        gather_lines(a, a_start, a_stride, n_part, n, n_each, first, True, memory_q)
        for i in range(n):
            s[i] = row_square(q, i, n_column)
        orthogonalise(q, r, n, n_column, memory_scratch, scratch)
        invert_triangle(r, t, n)
        if m > 0:
            gather_lines(b, b_start, b_stride, n_part, m, n_each, first, False, memory_b)
            for pair in range((m + 1) // 2):
                o, other = 2 * pair, min(2 * pair + 1, m - 1)
                for i in range(n):
                    rr, ii, ri, ir, rr_2, ii_2, ri_2, ir_2 = two_row_products(
                        right, o, right, other, q, i, n_column
                    )
                    w[o, i, 0] = rr - ii
                    w[o, i, 1] = ri + ir
                    w[other, i, 0] = rr_2 - ii_2
                    w[other, i, 1] = ri_2 + ir_2
        else:
            for i in range(n):
                for j in range(n_column):
                    w[j, i, 0] = q[i, j, 0]
                    w[j, i, 1] = q[i, j, 1]
        times_triangle(w, t, out, n_out, n)
        times_triangle(t, t, inverse, n, n)
        for lane in range(min(LANES, a_start.shape[0] - first)):
            line = first + lane
            for i in range(n):
                square[line, i] = memory_s[i, lane]
                for o in range(n_out):
                    x[line, o, i, 0] = memory_x[o, i, 0, lane]
                    x[line, o, i, 1] = memory_x[o, i, 1, lane]
                for k in range(n):
                    gram[line, i, k, 0] = memory_gram[i, k, 0, lane]
                    gram[line, i, k, 1] = memory_gram[i, k, 1, lane]


@fused_kernel
def joint_lines(u, y, r, start, stride, sizes, x, gram, square):  # type: ignore[no-untyped-def]
    """``x = Y R^H (U R^H)^-1`` of every line, and ``gram = A^H A`` of ``A = R^H (U R^H)^-1``.

    With orthonormal columns Q that span ``R^H`` these are ``Y Q (U Q)^-1`` and ``(U Q (U Q)^H)^-1``: how R itself is
    conditioned does not matter. U, Y and R stand alike; `sizes` as in `divide_lines`, as many outputs as inputs;
    `square` (n_line, n) of the rows of U.
    """
    n_part, n, n_each = sizes[0], sizes[1], sizes[2]
    n_column, n_line = n_part * n_each, start.shape[0]
    memory_u, memory_y = aligned(n, n_column), aligned(n, n_column)
    memory_r, memory_s = aligned(n, n_column), np.empty((n, LANES))
    memory_q, memory_k = aligned(n, n), aligned(n, n)
    memory_w, memory_x = aligned(n, n), aligned(n, n)
    memory_e, memory_t = aligned(n, n), aligned(n, n)
    memory_scratch = np.empty((2, LANES))
    left, output, basis = lanes_of(memory_u), lanes_of(memory_y), lanes_of(memory_r)
    s, q, on_basis, w = lanes_of(memory_s), lanes_of(memory_q), lanes_of(memory_k), lanes_of(memory_w)
    out, e, t, scratch = lanes_of(memory_x), lanes_of(memory_e), lanes_of(memory_t), lanes_of(memory_scratch)
    for first in range(0, n_line, LANES):
        gather_lines(u, start, stride, n_part, n, n_each, first, False, memory_u)
        gather_lines(y, start, stride, n_part, n, n_each, first, False, memory_y)
        gather_lines(r, start, stride, n_part, n, n_each, first, True, memory_r)
        orthogonalise(basis, e, n, n_column, memory_scratch, scratch)
        for i in range(n):
            s[i] = row_square(left, i, n_column)
            for k in range(n):
                rr, ii, ri, ir, rr_2, ii_2, ri_2, ir_2 = two_row_products(
                    left, i, output, i, basis, k, n_column
                )
                q[i, k, 0] = rr - ii  # conjugate of U Q
                q[i, k, 1] = -ri - ir
                on_basis[i, k, 0] = rr_2 - ii_2
                on_basis[i, k, 1] = ri_2 + ir_2
        orthogonalise(q, e, n, n, memory_scratch, scratch)
        invert_triangle(e, t, n)
        for i in range(n):
            for k in range(n):
                rr, ii, ri, ir = row_products(on_basis, i, q, k, n)
                w[i, k, 0] = rr - ii
                w[i, k, 1] = ri + ir
        times_triangle(w, t, out, n, n)
        times_triangle(t, t, q, n, n)
        for lane in range(min(LANES, n_line - first)):
            line = first + lane
            for i in range(n):
                square[line, i] = memory_s[i, lane]
                for k in range(n):
                    x[line, i, k, 0] = memory_x[i, k, 0, lane]
                    x[line, i, k, 1] = memory_x[i, k, 1, lane]
                    gram[line, i, k, 0] = memory_q[i, k, 0, lane]
                    gram[line, i, k, 1] = memory_q[i, k, 1, lane]
