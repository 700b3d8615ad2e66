"""Matrices divided by matrices, line by line: least squares and inverses for thousands of lines at once.

``X = B A^+`` is what every estimator of a response does with its spectra: outputs divided by inputs, directly or by
way of the references. The work is done by `division_kernel`, eight lines at a time, and by numpy where there are few
lines; twins by singular values stand in its tests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray

SMALLEST = 1e-9
"""Of the largest axis: one below that moved by rounding errors only, and is not scaled up to the others."""

FEW = 200
"""Lines up to which numpy divides: compiling the kernel takes two seconds, once, and saves milliseconds there."""


@dataclass(frozen=True)
class Quotient:
    """What dividing by A yields, with the right inverse ``A^+`` (in general any, ``A A^+ = I``).

    `value` is ``B A^+``, or ``A^+`` where no B was given; `gram_inverse` is ``A^+^H A^+``, ``(A A^H)^-1`` for the
    pseudo-inverse. `condition` is the product of the norms of A and of its inverse, the rows of A divided by their
    root mean square over the lines first, so that units and sizes of the axes do not count. Where it comes near the
    limit these are spectral norms, and it is infinite where A has no full rank; elsewhere they are Frobenius norms,
    and it is at most n times as large. Where it exceeds the limit the other two are NaN.
    """

    value: ComplexArray
    gram_inverse: ComplexArray
    condition: FloatArray


def divide(
    a: ComplexArray,
    b: ComplexArray | None,
    condition_limit: float,
    *,
    parts: bool = False,
    equalise: bool = True,
    compiled: bool | None = None,
) -> Quotient:
    """Divide b by a at each line, ``B A^+`` with ``A^+ = A^H (A A^H)^-1``.

    Parameters
    ----------
    a, b
        Shapes (..., n_line, n, n_column) and (..., n_line, m, n_column), n_column >= n; b None: the inverse is
        wanted. With `parts` they are (..., n_part, n_line, n, n_column) and stand side by side.
    condition_limit
        Lines above it are refused.
    equalise
        Whether the rows of A are brought to equal size before its condition is judged.
    compiled
        Whether the kernel divides; None: from `FEW` lines on.

    Returns
    -------
    Shapes (..., n_line, m, n), (..., n_line, n, n) and (..., n_line). What is not a number in a or b spreads.
    """
    shape, n_part = _lines_of(a.shape, parts)
    n, n_each = a.shape[-2:]
    n_line, m = int(np.prod(shape)), 0 if b is None else b.shape[-2]
    flat, start, stride = _placed(a, parts)
    other = (flat[:0], start, stride) if b is None else _placed(b, parts)
    value = np.empty((n_line, m if m else n_part * n_each, n), dtype=np.complex128)
    gram, square = np.empty((n_line, n, n), dtype=np.complex128), np.empty((n_line, n))
    sizes = np.array([n_part, n, n_each, m])
    if n_line > FEW if compiled is None else compiled:
        from robid_core.estimation.response.division_kernel import divide_lines

        divide_lines(flat, start, stride, *other, sizes, _real(value), _real(gram), square)
    else:
        left = _matrices(flat, start, stride, (n_part, n, n_each))
        right = None if b is None else _matrices(other[0], other[1], other[2], (n_part, m, n_each))
        value[:], gram[:], square[:] = _divide_few(left, right)

    def norms(line: int, size: FloatArray) -> float:
        matrix = _matrix(flat, start[line], stride, (n_part, n, n_each)) / size[:, None]
        singular = np.linalg.svd(matrix, compute_uv=False)
        return float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf

    squares = square.reshape(*shape, n)
    size = _sizes(squares) if equalise else np.ones((*shape[:-1], n))
    condition = _judge(squares, gram, size, norms, condition_limit, value)
    return Quotient(value.reshape(*shape, *value.shape[1:]), gram.reshape(*shape, n, n), condition)


def _divide_few(a: ComplexArray, b: ComplexArray | None) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """``B A^+`` (``A^+`` without B), ``(A A^H)^-1`` and the squares of A's rows, by QR decompositions of numpy.

    Takes (n_line, n, n_column) and (n_line, m, n_column); returns (n_line, m, n), (n_line, n, n) and (n_line, n). Lines
    whose A has rows that depend on one another, or no number, are NaN.
    """
    q, r = np.linalg.qr(a.conj().swapaxes(-1, -2))
    diagonal = np.einsum("lii->li", r)
    known = np.isfinite(r).all(axis=(-2, -1)) & (diagonal != 0).all(axis=-1)
    inverse = np.linalg.inv(np.where(known[:, None, None], r, np.eye(r.shape[-1], dtype=np.complex128)))
    inverse[~known] = np.nan
    adjoint = inverse.conj().swapaxes(-1, -2)
    value = np.asarray((q if b is None else b @ q) @ adjoint, dtype=np.complex128)
    gram = np.asarray(inverse @ adjoint, dtype=np.complex128)
    return value, gram, np.sum(np.abs(a) ** 2, axis=-1)


def divide_jointly(u: ComplexArray, y: ComplexArray, r: ComplexArray, condition_limit: float) -> Quotient:
    """``Y A`` with ``A = R^H (U R^H)^-1`` over the parts of each line; `gram_inverse` is ``A^H A``.

    Takes three times the shape (..., n_part, n_line, n, n_column), parts side by side, n_part n_column >= n; returns
    (..., n_line, n, n) twice and (..., n_line). The condition is that of U with A in the place of its inverse: how
    much larger what is not caused by R comes out, relative to what is, than in the best case.
    """
    from robid_core.estimation.response.division_kernel import joint_lines

    shape, n_part = _lines_of(u.shape, parts=True)
    n, n_each = u.shape[-2:]
    n_line = int(np.prod(shape))
    (flat_u, start, stride), (flat_y, *_), (flat_r, *_) = (_placed(x, parts=True) for x in (u, y, r))
    value, gram = (np.empty((n_line, n, n), dtype=np.complex128) for _ in range(2))
    square = np.empty((n_line, n))
    sizes = np.array([n_part, n, n_each, n])
    joint_lines(flat_u, flat_y, flat_r, start, stride, sizes, _real(value), _real(gram), square)

    def norms(line: int, size: FloatArray) -> float:
        left, right = (_matrix(x, start[line], stride, (n_part, n, n_each)) for x in (flat_u, flat_r))
        return _joint_norms(left / size[:, None], right)

    squares = square.reshape(*shape, n)
    condition = _judge(squares, gram, _sizes(squares), norms, condition_limit, value)
    return Quotient(value.reshape(*shape, n, n), gram.reshape(*shape, n, n), condition)


def _sizes(square: FloatArray) -> FloatArray:
    """Size of each row over the lines, from the squares at each (..., n_line, n); returns (..., n)."""
    size = np.sqrt(np.mean(square, axis=-2))
    largest = size.max(axis=-1, keepdims=True)
    result: FloatArray = np.maximum(size, np.where(largest > 0, SMALLEST * largest, 1.0))
    return result


def _joint_norms(u: ComplexArray, r: ComplexArray) -> float:
    try:
        inverse = r.conj().T @ np.linalg.inv(u @ r.conj().T)
    except np.linalg.LinAlgError:
        return float(np.inf)
    norms = np.linalg.norm(u, 2) * np.linalg.norm(inverse, 2)
    return float(norms) if np.isfinite(norms) else float(np.inf)


def _judge(
    square: FloatArray,
    gram: ComplexArray,
    size: FloatArray,
    norms: Callable[[int, FloatArray], float],
    condition_limit: float,
    value: ComplexArray,
) -> FloatArray:
    """Condition of each line (..., n_line); refused lines of `value` and `gram`, flat over the lines, become NaN.

    ``|A|^2 |A^+|^2 = sum_i a_i / d_i^2 sum_i d_i^2 g_ii`` with the squares a_i of the rows of A, the diagonal g_ii of
    the inverse Gram matrix and the sizes d_i.
    """
    by_line = np.broadcast_to(size[..., None, :], square.shape)
    diagonal = np.einsum("lii->li", gram).real.reshape(square.shape)
    with np.errstate(invalid="ignore", over="ignore"):
        inner = np.einsum("...i,...i->...", square, by_line**-2.0)
        outer = np.einsum("...i,...i->...", diagonal, by_line**2)
        condition: FloatArray = np.sqrt(inner * outer).ravel()
    sizes = by_line.reshape(-1, square.shape[-1])
    near = np.flatnonzero(~(condition <= condition_limit))
    for line in near:  # few: Frobenius norms only bound the others
        known = np.isfinite(square.reshape(sizes.shape)[line]).all()
        condition[line] = norms(int(line), sizes[line]) if known else np.nan
    refused = near[~(condition[near] <= condition_limit)]
    value[refused], gram[refused] = np.nan, np.nan
    return condition.reshape(square.shape[:-1])


def _lines_of(shape: tuple[int, ...], parts: bool) -> tuple[tuple[int, ...], int]:
    return ((*shape[:-4], shape[-3]), shape[-4]) if parts else (shape[:-2], 1)


def _placed(matrices: ComplexArray, parts: bool) -> tuple[FloatArray, IntArray, IntArray]:
    """Flat numbers, where the first entry of each line stands, and the strides of part, row and column."""
    whole = np.require(matrices, np.complex128, ["C", "W"])
    shape, n_part = _lines_of(whole.shape, parts)
    n, n_each = whole.shape[-2:]
    size = n * n_each
    flat: FloatArray = whole.reshape(-1).view(np.float64)
    if not parts:
        return flat, np.arange(int(np.prod(shape))) * size, np.array([0, n_each, 1])
    n_line = shape[-1]
    leading = np.arange(int(np.prod(shape[:-1])))[:, None] * (n_part * n_line * size)
    return flat, (leading + np.arange(n_line) * size).ravel(), np.array([n_line * size, n_each, 1])


def _real(matrices: ComplexArray) -> FloatArray:
    return matrices.view(np.float64).reshape(*matrices.shape, 2)


def _matrix(flat: FloatArray, start: int, stride: IntArray, sizes: tuple[int, int, int]) -> ComplexArray:
    """Matrix of one line, (n_row, n_part n_column)."""
    whole: ComplexArray = _matrices(flat, np.array([start]), stride, sizes)[0]
    return whole


def _matrices(
    flat: FloatArray, start: IntArray, stride: IntArray, sizes: tuple[int, int, int]
) -> ComplexArray:
    """Matrices of the lines that start there, parts side by side, (n_line, n_row, n_part n_column)."""
    part, row, column = (np.arange(size) for size in sizes)
    inside = part[:, None] * stride[0] + row[:, None, None] * stride[1] + column * stride[2]
    whole: ComplexArray = flat.view(np.complex128)[start[:, None] + inside.ravel()]
    return whole.reshape(len(start), sizes[1], -1)
