"""Optimal weights of candidate experiments (4.5), their certificate, and whole numbers of experiments.

Sources: Kiefer and Wolfowitz 1960 (equivalence theorem), Pukelsheim and Rieder 1992 (efficient rounding).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from robid_core import FloatArray, IntArray, NotTrustworthy

Criterion = Literal["D", "A"]


def optimal_weights(information: FloatArray, criterion: Criterion) -> FloatArray:
    """Weights that minimise log det M^-1 (D) or tr M^-1 (A), M = sum of weight times information.

    Parameters
    ----------
    information
        Shape (n_candidate, n, n), positive semidefinite; their sum must be definite.

    Returns
    -------
    Weights, shape (n_candidate,), non-negative, sum 1.

    Raises
    ------
    NotTrustworthy
        If the solver finds no optimum.
    """
    import cvxpy  # a second and a half of import: only where it is used

    n_candidate, n, _ = information.shape
    # D is invariant to scaling, A is not: whiten for D, scale by a number for A.
    scaled, shape = information / np.trace(information.mean(axis=0)) * n, np.eye(n)
    if criterion == "D":
        inverse_root = np.linalg.inv(np.linalg.cholesky(information.mean(axis=0)))
        scaled = inverse_root @ information @ inverse_root.T
    weight = cvxpy.Variable(n_candidate, nonneg=True)
    total = cvxpy.reshape(scaled.reshape(n_candidate, -1).T @ weight, (n, n), order="C")
    goal = -cvxpy.log_det(total) if criterion == "D" else cvxpy.matrix_frac(shape, total)
    problem = cvxpy.Problem(cvxpy.Minimize(goal), [cvxpy.sum(weight) == 1])
    problem.solve(solver=cvxpy.CLARABEL)
    if weight.value is None or problem.status not in ("optimal", "optimal_inaccurate"):
        raise NotTrustworthy(
            f"no optimal weights: the solver says '{problem.status}'; are two candidates alike?"
        )
    found = np.maximum(weight.value, 0.0)
    found[found < 1e-6 * found.max()] = 0.0
    result: FloatArray = found / found.sum()
    return result


def certificate_gap(information: FloatArray, weight: FloatArray, criterion: Criterion) -> float:
    """Bound on what any other weights could gain (equivalence theorem), 0 at the optimum.

    D: max_i tr(M^-1 H_i) - n bounds the rise of log det M. A: max_i tr(M^-1 H_i M^-1) / tr M^-1 - 1 bounds the
    relative fall of tr M^-1 to first order.
    """
    inverse = np.linalg.inv(np.einsum("i,ijk->jk", weight, information))
    if criterion == "D":
        return float(np.einsum("jk,ikj->i", inverse, information).max() - len(inverse))
    squared = inverse @ inverse
    return float(np.einsum("jk,ikj->i", squared, information).max() / np.trace(inverse) - 1)


def whole_experiments(weight: FloatArray, experiments: int) -> IntArray:
    """Round weights to whole experiments (Pukelsheim and Rieder): shape of `weight`, sum `experiments`.

    With more supported candidates than experiments, the heaviest ones are kept.
    """
    support = np.argsort(-weight, kind="stable")[: min(experiments, int((weight > 0).sum()))]
    share = weight[support] / weight[support].sum()
    count = np.maximum(np.ceil((experiments - len(support) / 2) * share), 1).astype(np.int64)
    with np.errstate(over="ignore"):  # a share that is next to nothing: infinity says what it should
        while count.sum() < experiments:
            count[np.argmin(count / share)] += 1
        while count.sum() > experiments:
            reducible = np.where(count > 1, (count - 1) / share, -np.inf)
            count[np.argmax(reducible)] -= 1
    result = np.zeros(len(weight), dtype=np.int64)
    result[support] = count
    return result


def criterion_value(information: FloatArray, weight: FloatArray, criterion: Criterion) -> float:
    """Value per parameter that efficiency compares: det(M)^(1/n) for D, n / tr M^-1 for A."""
    total = np.einsum("i,ijk->jk", weight, information)
    if criterion == "D":
        return float(np.exp(np.linalg.slogdet(total)[1] / len(total)))
    return float(len(total) / np.trace(np.linalg.inv(total)))
