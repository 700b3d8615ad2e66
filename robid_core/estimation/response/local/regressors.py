"""The linear equations of a window: regressors of numerator, denominator and transient (thesis eq. 3.19, 3.28, 3.31).

A row is a line and an experiment. Everything is batched over windows (leading axis n); windows of fewer lines
than the largest are filled up with rows of zeros, which say nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.window import Windows


@dataclass(frozen=True)
class WindowData:
    """Data of some windows: `offset` (n, w), `u` (n, w, n_exp, n_in), `y` (n, w, n_exp, n_out).

    `count` (n, w) is one for lines that count and zero for those that fill up.
    """

    offset: FloatArray
    count: FloatArray
    u: ComplexArray
    y: ComplexArray


def window_data(u: ComplexArray, y: ComplexArray, windows: Windows, chunk: slice) -> WindowData:
    """Collect the lines of some windows from spectra (n_freq, n_in, n_exp) and (n_freq, n_out, n_exp)."""
    index, counts = windows.lines(chunk)
    count = counts.astype(np.float64)
    zero = count[..., None, None]
    return WindowData(
        windows.offset(chunk) * count,
        count,
        u[index].swapaxes(-1, -2) * zero,
        y[index].swapaxes(-1, -2) * zero,
    )


def powers(offset: FloatArray, order: int) -> FloatArray:
    """``1, t, ..., t^order`` along a new last axis."""
    result: FloatArray = offset[..., None] ** np.arange(order + 1)
    return result


@dataclass(frozen=True)
class Regressors:
    """``y + B vec(D) = A vec(N) + error``, rows weighted and freed from transients.

    `numerator` A (n, row, (order + 1) * n_in), coefficient by coefficient, so that G stands in the first n_in
    columns; `denominator` B (n, row, order, n_out), the outputs times powers of t; `output` (n, row, n_out).
    """

    numerator: ComplexArray
    denominator: ComplexArray
    output: ComplexArray


def regressors(data: WindowData, model: LocalModel, weight: ComplexArray | None = None) -> Regressors:
    """Regressors of windows; `weight` (n, w) multiplies the equations of a line."""
    n, w, n_exp = data.u.shape[:3]
    n_out = data.y.shape[-1]
    t = powers(data.offset, max(model.numerator_order, model.denominator_order))
    scale = data.count if weight is None else weight * data.count
    u, y = data.u * scale[..., None, None], data.y * scale[..., None, None]
    numerator = t[:, :, None, : model.numerator_order + 1, None] * u[:, :, :, None, :]
    denominator = t[:, :, None, 1 : model.denominator_order + 1, None] * y[:, :, :, None, :]
    parts = [
        numerator.reshape(n, w, n_exp, -1),
        denominator.reshape(n, w, n_exp, -1),
        y,
    ]
    if model.transient_order is not None:
        parts = [without_transient(part, data, model.transient_order, scale) for part in parts]
    numerator, denominator, output = (part.reshape(n, w * n_exp, part.shape[-1]) for part in parts)
    return Regressors(numerator, denominator.reshape(n, w * n_exp, model.denominator_order, n_out), output)


def without_transient(
    columns: ComplexArray, data: WindowData, order: int, scale: ComplexArray | FloatArray
) -> ComplexArray:
    """Take from every column (n, w, n_exp, m) what a polynomial of each experiment's own explains.

    Least squares with these polynomials among the regressors is least squares of what they leave of the others.
    """
    polynomial = powers(data.offset, order) * scale[..., None]
    basis, _ = np.linalg.qr(polynomial.astype(np.complex128))
    flat = columns.reshape(*columns.shape[:2], -1)
    for _ in range(2):  # twice, so that what is left is orthogonal to rounding
        flat = flat - basis @ (basis.conj().swapaxes(-1, -2) @ flat)
    return flat.reshape(columns.shape)
