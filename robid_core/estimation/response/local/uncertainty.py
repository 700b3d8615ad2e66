"""From the solutions of all windows to the two factors of the covariance of each line.

Twice over the lines: first the residuals of all windows tell how much of them is torque disturbance and how much is
noise of the output; then each window's errors are carried to G with the course that follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.response.local.covariance import (
    Course,
    course,
    dense_covariance,
    disturbance_levels,
    error_deviation,
    nearest_product,
    residual_products,
)
from robid_core.estimation.response.local.joint import carry_dense
from robid_core.estimation.response.local.rational import Solution
from robid_core.estimation.response.local.regressors import WindowData
from robid_core.estimation.response.local.window import Windows


@dataclass(frozen=True)
class Piece:
    """Some windows: which, their data, what came of them, and the weights (n, w, n_out) of their equations."""

    chunk: slice
    data: WindowData
    solution: Solution
    weight: FloatArray

    @property
    def output(self) -> ComplexArray:
        """Outputs, weighted as the equations are, (n, row, n_out)."""
        weighted = self.data.y * self.weight[:, :, None]
        return weighted.reshape(len(weighted), -1, weighted.shape[-1])


def expected_course(
    piece: Piece, windows: Windows, freedom: FloatArray, products: ComplexArray, n_out: int
) -> Course:
    """Course of the residuals over the windows of a piece; `freedom` (n,) are its degrees of freedom."""
    data, solution = piece.data, piece.solution
    n, w, n_exp = data.u.shape[:3]
    free = (1.0 - solution.leverage).reshape(n, w, n_exp, -1).sum(axis=2) * data.count[..., None]
    relative = windows.frequency_hz[piece.chunk] / windows.frequency_hz[-1]
    free /= freedom[:, None, None]
    return course(
        solution.numerator,
        solution.denominator,
        data.offset,
        relative,
        free,
        products,
        n_out,
        piece.weight**2,
    )


def covariance_factors(
    pieces: Sequence[Piece],
    windows: Windows,
    freedom: FloatArray,
    valid: BoolArray,
    left: ComplexArray | None = None,
    right: ComplexArray | None = None,
) -> tuple[ComplexArray, ComplexArray]:
    """Factors (gram inverse, output covariance) of all lines; see `artifacts.frf`.

    Parameters
    ----------
    pieces
        All windows, in order.
    windows, freedom, valid
        Of all lines; some are valid, and each has more degrees of freedom than stated outputs.
    left, right
        What makes ``left X right`` of the fitted response X, (n_freq, n_out, n_fitted) and (n_freq, n_in, n_in);
        None where X is G itself.

    Returns
    -------
    Shapes (n_freq, n_in, n_in) and (n_freq, n_out, n_out); of lines that are not valid nothing worth using.
    """
    products = np.concatenate(
        [residual_products(p.solution.error, p.output, freedom[p.chunk]) for p in pieces]
    )
    n_out = products.shape[-1] if left is None else left.shape[1]
    courses = [expected_course(p, windows, freedom[p.chunk], products[p.chunk], n_out) for p in pieces]
    power = np.einsum("fii->fi", products).real
    level = disturbance_levels(power, np.concatenate([one.mean for one in courses]), valid)
    grams, covariances = [], []
    for piece, one in zip(pieces, courses, strict=True):
        deviation = error_deviation(one, level)
        chunk, s = piece.chunk, products[piece.chunk]
        n = len(s)
        centre = np.argmin(np.abs(piece.data.offset) + (piece.data.count == 0), axis=1)
        own = deviation[np.arange(n), centre] / piece.weight[np.arange(n), centre]
        c = s * own[:, :, None] * own[:, None, :]
        dense = dense_covariance(piece.solution, s, deviation)
        if left is not None and right is not None:
            dense = carry_dense(dense, left[chunk], right[chunk])
            c = left[chunk] @ c @ left[chunk].conj().swapaxes(-1, -2)
        # Anything positive definite will do where nothing is stated.
        bad = ~valid[chunk]
        n_in = dense.shape[2]
        c[bad] = np.eye(n_out)
        dense[bad] = np.eye(n_out * n_in).reshape(dense.shape[1:])
        gram, c = nearest_product(dense, c)
        grams.append(gram)
        covariances.append(c)
    return np.concatenate(grams), np.concatenate(covariances)
