"""Local polynomials over neighbouring lines: the weights with which values there give a smoothed value here.

The local variable is the true frequency offset, not the line index: lines of a logarithmic grid are not evenly
apart. A polynomial of degree d through 2 m + 1 lines by least squares, evaluated in the middle, is a weighted sum
of the values (A. Savitzky and M. Golay, 1964, for evenly spaced ones).
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.errors import DataRejected


def polynomial_weights(
    frequency_hz: FloatArray, half_window: int, degree: int
) -> tuple[IntArray, FloatArray]:
    """Neighbours of each line and their weights; at the ends of the band the window leans inward.

    Parameters
    ----------
    frequency_hz
        Lines, ascending, shape (n_freq,).
    half_window
        Lines on either side; 0: each line stands for itself.
    degree
        Of the polynomial, at most 2 half_window.

    Returns
    -------
    (index, weight), each (n_freq, 2 half_window + 1); the weights of a line sum to one.

    Raises
    ------
    DataRejected
        If there are fewer lines than a window holds.
    """
    n_freq, length = len(frequency_hz), 2 * half_window + 1
    if 0 < n_freq < length:
        raise DataRejected(
            f"{n_freq} usable lines are fewer than the {length} that a window of {half_window} lines on either "
            "side holds; excite more lines, or smooth over fewer"
        )
    first = np.clip(np.arange(n_freq) - half_window, 0, n_freq - length)
    index = first[:, None] + np.arange(length)
    offset = frequency_hz[index] - frequency_hz[:, None]
    offset /= np.maximum(np.abs(offset).max(axis=1, keepdims=True), np.finfo(float).tiny)
    powers = offset[..., None] ** np.arange(min(degree, 2 * half_window) + 1)
    # The value in the middle is the constant term: the first row of the pseudo-inverse.
    weight = np.linalg.pinv(powers)[:, 0]
    return index, weight


def smooth_over_lines(values: ComplexArray, index: IntArray, weight: FloatArray) -> ComplexArray:
    """Weighted sum over the neighbours of each line, ``sum_l w_kl x_l``; lines are the first axis."""
    result: ComplexArray = np.einsum("kl,kl...->k...", weight, values[index])
    return result


def products_through_smoothing(
    products: ComplexArray,
    response: ComplexArray,
    gram_inverse: ComplexArray,
    index: IntArray,
    weight: FloatArray,
) -> ComplexArray:
    """Products of the residual that reaches a response whose input was smoothed over lines.

    ``P_yy - w_0 (P_yu G^H + G P_uy) + G (sum_l w_l^2 s_l P_uu(l)) G^H``: of the lines in the window only the one
    in the middle has residuals in common with the output. s_l is the ratio of the references' inverse Gram
    matrices, ``tr(S_l^-1 S) / n``, exact where they differ by a factor. Without smoothing ``[I, -G] P [I, -G]^H``.

    Parameters
    ----------
    products
        Of the residuals [y; u] given the references, shape (n_freq, 2 n, 2 n).
    response, gram_inverse
        G and ``(R R^H)^-1`` at the lines, shape (n_freq, n, n) each.
    index, weight
        Windows of `polynomial_weights`.

    Returns
    -------
    Shape (n_freq, n, n).
    """
    n = response.shape[-1]
    own = np.where(index == np.arange(len(index))[:, None], weight, 0.0).sum(axis=1)[:, None, None]
    ratio = np.einsum("klij,kji->kl", gram_inverse[index], np.linalg.inv(gram_inverse)).real / n
    u_products = np.einsum("kl,klij->kij", weight**2 * ratio, products[index, n:, n:])
    adjoint = response.conj().swapaxes(-1, -2)
    cross = products[:, :n, n:] @ adjoint
    result: ComplexArray = products[:, :n, :n] + response @ u_products @ adjoint
    result -= own * (cross + cross.conj().swapaxes(-1, -2))
    return result
