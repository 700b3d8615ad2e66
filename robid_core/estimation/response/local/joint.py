"""From the response of reference to output and input to that of input to output (thesis, "LRM, JIO").

``G = G_ry G_ru^-1``: the reference knows nothing of the noise, so feedback does not bias this. To first order
``dG = [I, -G] dG_rz G_ru^-1`` with z = [y; u], so a covariance that is a Kronecker product stays one.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray


def condition_of(matrices: ComplexArray) -> FloatArray:
    """Condition numbers with rows scaled to equal size; infinite where a matrix is singular or not finite."""
    result = np.full(matrices.shape[:-2], np.inf)
    usable = np.isfinite(matrices).all(axis=(-1, -2)) & (np.abs(matrices).max(axis=-1) > 0).all(axis=-1)
    scaled = matrices[usable]
    result[usable] = np.linalg.cond(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))
    return result


def ratio(response: ComplexArray, n_out: int) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """``G = G_ry G_ru^-1`` with the two factors ``[I, -G]`` and ``G_ru^-1`` of its first-order error.

    Parameters
    ----------
    response
        From reference to [output; input], (..., n_out + n_in, n_in), the lower part invertible.
    """
    to_reference: ComplexArray = np.linalg.inv(response[..., n_out:, :]).astype(np.complex128)
    g: ComplexArray = response[..., :n_out, :] @ to_reference
    identity = np.broadcast_to(np.eye(n_out), (*g.shape[:-2], n_out, n_out))
    left: ComplexArray = np.concatenate((identity, -g), axis=-1)
    return g, left, to_reference


def carry_product(
    gram_inverse: ComplexArray, covariance: ComplexArray, left: ComplexArray, right: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Factors of the covariance of ``left X right`` from those of X.

    ``Cov vec X = conj(g) (x) C`` becomes ``conj(right^H g right) (x) left C left^H``.
    """
    gram = right.conj().swapaxes(-1, -2) @ gram_inverse @ right
    return gram, left @ covariance @ left.conj().swapaxes(-1, -2)


def carry_dense(dense: ComplexArray, left: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Covariance of all entries of ``left X right`` from that of X, both (n, row, column, row, column)."""
    n, n_row, n_column = dense.shape[:3]
    both = np.einsum("nia,nbj->nijab", left, right).reshape(n, -1, n_row * n_column)
    flat = dense.reshape(n, n_row * n_column, -1)
    carried = both @ flat @ both.conj().swapaxes(-1, -2)
    n_out, n_in = left.shape[1], right.shape[2]
    result: ComplexArray = carried.reshape(n, n_out, n_in, n_out, n_in)
    return result
