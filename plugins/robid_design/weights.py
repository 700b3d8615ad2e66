"""Optimal weights of candidate experiments (4.5), their certificate, and whole numbers of experiments.

Sources: Kiefer and Wolfowitz 1960 (equivalence theorem), Pukelsheim and Rieder 1992 (efficient rounding).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from robid_core import FloatArray, IntArray, NotTrustworthy

Criterion = Literal["D", "A"]
UNDETERMINED = (
    "are some springs determined by no candidate? take them out of the robot file, or more candidates"
)
LEAST_SHARE = 0.05
"""Of an experiment: a candidate with less is not measured..."""
LEAST_OF_LARGEST = 0.1
"""...unless it has so much of the largest weight: where all are small, all count."""


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
        If the solver finds no optimum, or their sum is singular.
    """
    import cvxpy  # a second and a half of import: only where it is used

    n_candidate, n, _ = information.shape
    # Whitened, so that the mean is the identity: D is invariant to it, A takes it into the trace.
    try:
        inverse_root = np.linalg.inv(np.linalg.cholesky(information.mean(axis=0)))
    except np.linalg.LinAlgError as error:
        raise NotTrustworthy(f"no optimal weights: {UNDETERMINED}") from error
    scaled = inverse_root @ information @ inverse_root.T
    weight = cvxpy.Variable(n_candidate, nonneg=True)
    total = cvxpy.reshape(scaled.reshape(n_candidate, -1).T @ weight, (n, n), order="C")
    constraints = [cvxpy.sum(weight) == 1]
    if criterion == "D":
        goal, within = _negative_root_of_determinant(total)
        constraints += within
    else:
        goal = cvxpy.matrix_frac(inverse_root / np.linalg.norm(inverse_root), total)
    problem = cvxpy.Problem(cvxpy.Minimize(goal), constraints)
    try:
        problem.solve(solver=cvxpy.CLARABEL)
        status = str(problem.status)
    except cvxpy.SolverError as error:
        status = str(error).partition(".")[0]
    if weight.value is None or status not in ("optimal", "optimal_inaccurate"):
        raise NotTrustworthy(
            f"no optimal weights: the solver says '{status}'; {UNDETERMINED}, or take the other criterion"
        )
    found = np.maximum(weight.value, 0.0)
    found[found < 1e-6 * found.max()] = 0.0
    result: FloatArray = found / found.sum()
    return result


def _negative_root_of_determinant(total: Any) -> tuple[Any, list[Any]]:
    """Return -det(total)^(1/n) and the constraints under which it holds (Boyd and Vandenberghe 2004, section 7.5.2).

    With symmetric cones only, the mean of n numbers as one of pairs, filled up with the mean itself: the exponential
    cone of log det is where Clarabel stopped when candidates were nearly alike, as all poses of one axis are.
    """
    import cvxpy

    n = total.shape[0]
    lower = cvxpy.Variable((n, n))
    diagonal = cvxpy.diag(lower)
    constraints = [cvxpy.bmat([[total, lower], [lower.T, cvxpy.diag(diagonal)]]) >> 0]
    if n > 1:
        constraints.append(cvxpy.upper_tri(lower) == 0)
    root = cvxpy.Variable()
    means = [*diagonal, *(root for _ in range((1 << (n - 1).bit_length()) - n))]
    while len(means) > 1:
        pairs = zip(means[::2], means[1::2], strict=True)
        means = [cvxpy.geo_mean(cvxpy.hstack(pair)) for pair in pairs]
    constraints.append(root <= means[0])
    return -root, constraints


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

    With more supported candidates than experiments, the heaviest ones are kept. Candidates with next to no share of
    an experiment get none: what they add to the information is as little.
    """
    worth = (experiments * weight >= LEAST_SHARE) | (weight >= LEAST_OF_LARGEST * weight.max())
    support = np.argsort(-weight, kind="stable")[: min(experiments, int((worth & (weight > 0)).sum()))]
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
