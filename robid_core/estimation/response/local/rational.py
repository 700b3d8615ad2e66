"""Local rational functions by least squares, the plain form: thesis eq. (3.20) with (3.28) and (3.31).

The numerator's regressors are the same whatever the denominator, so they are taken out first; what they leave of the
outputs and of the denominator's regressors gives the denominator, and that the numerator. This is least
squares of all unknowns at once (Frisch and Waugh), and shows what the parametrisations share. Where outputs
times powers of t are linear combinations of the inputs times powers of t, as with few modes and no noise, the
denominator is not unique; the one of least size is taken, and G does not depend on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.regressors import Regressors


@dataclass(frozen=True)
class Solution:
    """What the equations of windows give.

    `numerator` (n, order + 1, n_out, n_in), so that the first is G; `denominator` (n, order + 1, n_out, n_out), the
    first of it the identity; `error` (n, row, n_out) of the (weighted) equations. `condition` (n,) is that of the
    numerator's regressors, columns scaled.

    First-order effect of the error on G: ``dG[i, j] = sum_row influence[i, j, row] error[row, i]``, with `influence`
    (n, 1 or n_out, n_in, row), the same for all outputs where the second axis is one; with a common
    denominator further ``sum_s coupling[s, i, j] dd_s``, ``dd_s = sum_{row, k} pull[s, row, k] error[row,
    k]``. `leverage` (n, row, 1 or n_out) is the share of a row's error that the fit follows and the residual lacks.
    """

    numerator: ComplexArray
    denominator: ComplexArray
    error: ComplexArray
    condition: FloatArray
    influence: ComplexArray
    leverage: FloatArray
    coupling: ComplexArray | None = None
    pull: ComplexArray | None = None


QUIET = 0.3
"""Part of the noise of its terms below which a combination of outputs counts as free of noise; see `solve`."""


def solve(
    equations: Regressors,
    model: LocalModel,
    loop_freedom: FloatArray | None = None,
) -> Solution:
    """Least-squares solution for one denominator of the whole matrix, of each output, or a full matrix.

    Parameters
    ----------
    equations
        Of n windows.
    model
        Its orders and parametrisation are those the equations were made with.
    loop_freedom
        Degrees of freedom of the windows, (n,), for a full matrix fraction of signals in a loop. Some of their
        combinations have no noise there (u + F y with a controller F), so that next to nothing decides on the
        coefficients of D along these, and they come out so large that no first-order covariance holds.
        Combinations of the denominator's regressors with less than QUIET of the noise that their terms would
        have, by the residuals with all of them, are therefore left out.
    """
    a, y = equations.numerator, equations.output
    n, n_row, n_out = y.shape
    n_in, order = a.shape[-1] // (model.numerator_order + 1), model.denominator_order
    scale = np.linalg.norm(a, axis=1)
    scale = np.where(scale > 0, scale, 1.0)
    q, r = np.linalg.qr(a / scale[:, None, :])
    singular = np.linalg.svd(r, compute_uv=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.where(singular[:, -1] > 0, singular[:, 0] / singular[:, -1], np.inf)
    r = np.where((condition < 1e14)[:, None, None], r, np.eye(r.shape[-1]))
    inverse: ComplexArray
    inverse = np.linalg.solve(r, q.conj().swapaxes(-1, -2)).astype(np.complex128) / scale[:, :, None]

    def rest(columns: ComplexArray) -> ComplexArray:
        for _ in range(2):  # twice, so that what is left is orthogonal to rounding
            columns = columns - q @ (q.conj().swapaxes(-1, -2) @ columns)
        return columns

    b = equations.denominator.reshape(n, n_row, order * n_out)
    free_b, free_y = rest(b), rest(y)
    size = np.linalg.norm(b, axis=1).reshape(n, order, n_out)
    d = np.zeros((n, order, n_out, n_out), dtype=np.complex128)  # power, output of the regressor, equation
    pulls: ComplexArray | None = None
    by_power = free_b.reshape(n, n_row, order, n_out)
    if order and model.parametrization == "mimo":
        columns = _Columns.of(free_b, size.reshape(n, -1))
        usable = columns.regular
        if loop_freedom is not None:
            residual = np.sum(np.abs(free_y - columns.explained(free_y)) ** 2, axis=1)
            noise = np.sqrt(residual / np.maximum(loop_freedom, 1.0)[:, None])
            level = np.sqrt(np.mean(np.abs(y) ** 2, axis=1))
            relative = noise / np.where(level > 0, level, 1.0)
            usable = usable & columns.louder((size * relative[:, None, :]).reshape(n, -1))
        pulls = columns.left_inverse(usable)
        d = -(pulls @ free_y).reshape(n, order, n_out, n_out)
    elif order and model.parametrization == "miso":
        pulls = np.stack(
            [_Columns.of(by_power[..., i], size[..., i]).left_inverse() for i in range(n_out)], axis=1
        )
        coefficient = -np.einsum("nisr,nri->nsi", pulls, free_y)
        d = coefficient[..., None] * np.eye(n_out)
    elif order:
        level = np.sqrt(np.mean(np.abs(y) ** 2, axis=1))
        level = np.where(level > 0, level, 1.0)
        # Rows of all outputs under one another, each output scaled to equal size.
        stacked = np.moveaxis(by_power / level[:, None, None, :], 3, 1).reshape(n, -1, order)
        size = np.sqrt(np.sum((size / level[:, None, :]) ** 2, axis=2))
        flat = _Columns.of(stacked, size).left_inverse()
        pulls = flat.reshape(n, order, n_out, -1) / level[:, None, :, None]
        coefficient = -np.einsum("nsir,nri->ns", pulls, free_y)
        d = coefficient[:, :, None, None] * np.eye(n_out)
    error = free_y + np.einsum("nrsm,nsmi->nri", by_power, d)
    numerator = inverse @ (y + np.einsum("nrsm,nsmi->nri", equations.denominator, d))
    coefficients = numerator.reshape(n, model.numerator_order + 1, n_in, n_out).swapaxes(-1, -2)
    identity = np.broadcast_to(np.eye(n_out), (n, 1, n_out, n_out))
    denominator: ComplexArray = np.concatenate((identity, d.swapaxes(-1, -2)), axis=1)
    influence: ComplexArray = inverse[:, None, :n_in]
    coupling: ComplexArray | None = None
    pull: ComplexArray | None = None
    leverage = np.sum(np.abs(q) ** 2, axis=-1)[..., None]
    if pulls is not None and model.parametrization == "mimo":
        influence = influence - ((inverse[:, :n_in] @ b) @ pulls)[:, None]
        leverage = leverage + np.einsum("nrm,nmr->nr", free_b, pulls).real[..., None]
    elif pulls is not None:
        through = np.einsum("njr,nrsi->nsij", inverse[:, :n_in], equations.denominator)
        if model.parametrization == "miso":
            influence = influence - np.einsum("nsij,nisr->nijr", through, pulls)
            leverage = leverage + np.einsum("nrsi,nisr->nri", by_power, pulls).real
        else:
            coupling, pull = through, -pulls.swapaxes(-1, -2)
            leverage = leverage + np.einsum("nrsi,nsir->nri", by_power, pulls).real
    leverage = np.clip(leverage, 0.0, 1.0)
    return Solution(coefficients, denominator, error, condition, influence, leverage, coupling, pull)


@dataclass(frozen=True)
class _Columns:
    """Columns divided by their `unit` (n, column), as singular values: `left` (n, row, column), `singular`, `right`."""

    unit: FloatArray
    left: ComplexArray
    singular: FloatArray
    right: ComplexArray

    @classmethod
    def of(cls, columns: ComplexArray, size: FloatArray) -> _Columns:
        """Columns that had this `size` before the numerator's regressors were taken from them."""
        unit = np.where(size > 0, size, 1.0)
        return cls(unit, *np.linalg.svd(columns / unit[:, None, :], full_matrices=False))

    @property
    def regular(self) -> BoolArray:
        """Directions with more left than rounding errors."""
        result: BoolArray = self.singular > 1e-13 * np.sqrt(self.left.shape[1])
        return result

    def louder(self, noise: FloatArray) -> BoolArray:
        """Directions with at least QUIET of the `noise` of their columns, (n, column)."""
        own = np.linalg.norm(self.right * (noise / self.unit)[:, None, :], axis=2)
        result: BoolArray = self.singular > QUIET * own
        return result

    def explained(self, y: ComplexArray) -> ComplexArray:
        """Part of y (n, row, m) in the span of the regular directions."""
        left = self.left * self.regular[:, None, :]
        return left @ (left.conj().swapaxes(-1, -2) @ y)

    def left_inverse(self, usable: BoolArray | None = None) -> ComplexArray:
        """Pseudo-inverse with the `usable` directions alone, or the regular ones."""
        usable = self.regular if usable is None else usable
        reciprocal = np.where(usable, 1.0 / np.where(usable, self.singular, 1.0), 0.0)
        way = self.right.conj().swapaxes(-1, -2) / self.unit[:, :, None]
        result: ComplexArray = (way * reciprocal[:, None, :]) @ self.left.conj().swapaxes(-1, -2)
        return result
