"""Fits of all lines by the plain form: any parametrisation, transients, iterations, denominators that are known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.estimation.response.local.iteration import Pass, iterate
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.rational import Solution, solve
from robid_core.estimation.response.local.regressors import WindowData, regressors, window_data
from robid_core.estimation.response.local.result import polynomial
from robid_core.estimation.response.local.uncertainty import Piece, covariance_factors
from robid_core.estimation.response.local.window import Windows

WORKING_NUMBERS = 2_000_000
"""Complex numbers in the regressors of the windows that are solved together; bounds the memory, changes no result."""


@dataclass(frozen=True)
class PlainFit:
    """Solutions of all windows; `condition` and `passes` have shape (n_freq,)."""

    windows: Windows
    numerator: ComplexArray
    denominator: ComplexArray
    condition: FloatArray
    passes: IntArray
    pieces: tuple[Piece, ...]

    def factors(
        self, freedom: FloatArray, valid: BoolArray, left: ComplexArray | None, right: ComplexArray | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Factors of the covariance; see `uncertainty.covariance_factors`."""
        return covariance_factors(self.pieces, self.windows, freedom, valid, left, right)

    def own_gram(self) -> ComplexArray:
        """Variance of each output's row of G for errors of variance one, (n_freq, n_out or 1, n_in, n_in)."""
        influences = [piece.solution.influence for piece in self.pieces]
        return np.concatenate([own.conj() @ own.swapaxes(-1, -2) for own in influences])


def plain_fit(
    u: ComplexArray,
    y: ComplexArray,
    windows: Windows,
    model: LocalModel,
    *,
    iterations: int = 0,
    denominators: ComplexArray | None = None,
    loop_freedom: FloatArray | None = None,
) -> PlainFit:
    """Fit all lines.

    Parameters
    ----------
    u, y
        Spectra (n_freq, n_in, n_exp) and (n_freq, n_out, n_exp).
    windows, model
        Which lines belong together, and what is fitted to them.
    iterations
        Further passes; see `iteration`.
    denominators
        Known scalar ones, coefficients (n_freq, order + 1) in the local variable; then only the numerator is
        fitted, to the output error, and the order of the model's denominator counts for nothing.
    loop_freedom
        Degrees of freedom (n_freq,) where the outputs are signals of a loop; see `rational.solve`.
    """
    n_out, n_in, n_exp = y.shape[1], u.shape[1], u.shape[2]
    pieces, passes = [], []
    for chunk in chunks(windows, model, n_in, n_out, n_exp):
        data = window_data(u, y, windows, chunk)
        if denominators is None:
            freedom = None if loop_freedom is None else loop_freedom[chunk]
            best, kept = iterate(data, model, iterations, freedom)
        else:
            best, kept = _known(data, model, denominators[chunk]), np.zeros(len(data.offset), dtype=np.int64)
        pieces.append(Piece(chunk, data, best.solution, best.weight))
        passes.append(kept)
    solutions = [piece.solution for piece in pieces]
    return PlainFit(
        windows,
        np.concatenate([one.numerator for one in solutions]),
        np.concatenate([one.denominator for one in solutions]),
        np.concatenate([one.condition for one in solutions]),
        np.concatenate(passes),
        tuple(pieces),
    )


def _known(data: WindowData, model: LocalModel, denominators: ComplexArray) -> Pass:
    """Numerators to known denominators, by least squares of the output error."""
    n_out = data.y.shape[-1]
    d = polynomial(denominators[..., None, None], data.offset)[..., 0, 0]
    size = np.where(data.count > 0, np.abs(d), 1.0)
    weight = 1.0 / np.maximum(size, 1e-12 * size.max(axis=1, keepdims=True))
    times = replace(data, y=data.y * d[..., None, None])
    numerator_only = replace(model, denominator_order=0, parametrization="scalar")
    solution = solve(regressors(times, numerator_only, weight.astype(np.complex128)), numerator_only)
    full = denominators[..., None, None] * np.eye(n_out)
    solution = Solution(
        solution.numerator, full, solution.error, solution.condition, solution.influence, solution.leverage
    )
    return Pass(solution, np.repeat(weight[..., None], n_out, axis=-1), np.zeros(len(d)))


def chunks(windows: Windows, model: LocalModel, n_in: int, n_out: int, n_exp: int) -> Iterator[slice]:
    """Portions of the lines whose regressors fit in the working memory."""
    columns = (model.numerator_order + 1) * n_in + (model.denominator_order + 1) * n_out
    step = max(1, WORKING_NUMBERS // (int(windows.size.max()) * n_exp * columns))
    n_freq = len(windows.frequency_hz)
    for start in range(0, n_freq, step):
        yield slice(start, min(start + step, n_freq))
