"""Information that a frequency response carries about parameters, and what it leaves invisible.

Thesis (4.4): ``H = 2 Re{ conj(Psi) Lambda^-1 Psi^T }`` with Psi^T = d vec(G) / d theta, summed over lines. With
a Kronecker covariance ``Lambda = conj(S^-1) (x) C`` (S: Gram matrix of the inputs) and rank-one derivatives
``dG/dtheta_p = f_p x_p x_p^T`` the sum over entries becomes an element-wise product of two small Gram matrices.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import NotIdentifiable


def information_of_rank_one(
    vectors: ComplexArray, factors: ComplexArray, input_gram: ComplexArray, output_weight: ComplexArray
) -> FloatArray:
    """Information matrix (4.4) from factored derivatives.

    With dG_p = f_p x_p x_p^T: vec(dG_p) = f_p (x_p (x) x_p), hence
    ``vec(dG_p)^H Lambda^-1 vec(dG_q) = conj(f_p) f_q (x_p^H conj(S) x_q) (x_p^H C^-1 x_q)``.

    Parameters
    ----------
    vectors
        x_p at each line, shape (n_freq, n_parameter, n_axis).
    factors
        f_p at each line, shape (n_freq, n_parameter).
    input_gram
        S, shape (n_freq, n_axis, n_axis), Hermitian.
    output_weight
        C^-1, shape (n_freq, n_axis, n_axis), Hermitian.

    Returns
    -------
    H, real symmetric, shape (n_parameter, n_parameter).
    """
    inputs = np.einsum("fpi,fij,fqj->fpq", vectors.conj(), input_gram.conj(), vectors, optimize=True)
    outputs = np.einsum("fpi,fij,fqj->fpq", vectors.conj(), output_weight, vectors, optimize=True)
    total = np.einsum("fp,fq,fpq,fpq->pq", factors.conj(), factors, inputs, outputs, optimize=True)
    information: FloatArray = 2 * total.real
    return 0.5 * (information + information.T)


def covariance_of_parameters(information: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """Inverse of an information matrix.

    Raises
    ------
    NotIdentifiable
        If a combination of parameters is invisible; the message names its largest members.
    """
    scale = np.sqrt(np.diag(information))
    if not np.all(scale > 0):
        blind = [names[i] for i in np.flatnonzero(~(scale > 0))]
        raise NotIdentifiable(
            f"the data do not see {', '.join(blind)}; hold it, or add configurations that move it"
        )
    values, directions = np.linalg.eigh(information / np.outer(scale, scale))
    if values[0] < 1e-12 * values[-1]:
        members = np.argsort(-np.abs(directions[:, 0]))[:3]
        combination = ", ".join(names[i] for i in members)
        raise NotIdentifiable(
            f"the data see the parameters {combination} only together; hold one of them, or add configurations"
        )
    inverse: FloatArray = (directions / values) @ directions.T / np.outer(scale, scale)
    return inverse
