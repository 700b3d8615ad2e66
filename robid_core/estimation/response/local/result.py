"""What a local fit gives: the response with its uncertainty, and the functions it was read from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.estimation.response.local.regressors import powers
from robid_core.estimation.response.local.window import Windows


@dataclass(frozen=True)
class LocalFit:
    """Response (n_freq, n_out, n_in) from local rational functions; NaN where `valid` (n_freq,) is false.

    The covariance of vec(G) is ``conj(gram_inverse) (x) output_covariance``, shapes (n_freq, n_in, n_in) and
    (n_freq, n_out, n_out); the latter is None where windows leave fewer degrees of freedom than outputs.
    `degrees_of_freedom` (n_freq,) are complex, zero on lines that are not valid.

    `numerator` (n_freq, order + 1, n_fitted, n_in) and `denominator` (n_freq, order + 1, n_fitted, n_fitted) are the
    coefficients in powers of the local variable. Joint fits are of outputs and inputs over the reference
    (n_fitted = n_out + n_in), others have n_fitted = n_out. `passes` (n_freq,) counts the iterations behind
    each line.
    """

    windows: Windows
    response: ComplexArray
    gram_inverse: ComplexArray
    output_covariance: ComplexArray | None
    degrees_of_freedom: FloatArray
    valid: BoolArray
    numerator: ComplexArray
    denominator: ComplexArray
    passes: IntArray
    words: tuple[str, ...] = ()
    """What was chosen by the data, for people."""

    @property
    def first(self) -> IntArray:
        """First line of each window."""
        return self.windows.first

    @property
    def last(self) -> IntArray:
        """Last line of each window."""
        return self.windows.last

    def around(self, line: int, frequency_hz: FloatArray) -> ComplexArray:
        """Return what the local function of a line says at other frequencies, (n, n_out, n_in); thesis fig. 3.4.

        Meant for frequencies inside the line's window.
        """
        offset = (frequency_hz - self.windows.frequency_hz[line]) / self.windows.half_width_hz[line]
        local: ComplexArray
        local = rational_response(self.numerator[line][None], self.denominator[line][None], offset[None])[0]
        n_out = self.response.shape[1]
        if local.shape[1] > n_out:
            local = local[:, :n_out] @ np.linalg.inv(local[:, n_out:]).astype(np.complex128)
        return local


def rational_response(numerator: ComplexArray, denominator: ComplexArray, offset: FloatArray) -> ComplexArray:
    """``D(t)^-1 N(t)`` of n functions at offsets t (n, w): shape (n, w, n_out, n_in); NaN where D is singular."""
    n, d = polynomial(numerator, offset), polynomial(denominator, offset)
    regular = np.abs(np.linalg.det(np.nan_to_num(d))) > 0
    safe = np.where(regular[..., None, None], d, np.eye(d.shape[-1]))
    result: ComplexArray = np.linalg.solve(safe, n).astype(np.complex128)
    result[~regular] = np.nan
    return result


def polynomial(coefficients: ComplexArray, offset: FloatArray) -> ComplexArray:
    """Matrix polynomials (n, order + 1, a, b) at offsets (n, w): shape (n, w, a, b)."""
    t = powers(offset, coefficients.shape[1] - 1)
    result: ComplexArray = np.einsum("nws,nsab->nwab", t, coefficients)
    return result
