"""What a fit left, prepared for columns of candidates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import FloatArray
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.projection import Projection


def projection_of(fitted: Fitted) -> tuple[Projection, list[list[int]]]:
    """Prepare what was fitted; folds are experiments, groups those of one configuration."""
    projection, groups, _ = projection_without(fitted, ())
    return projection, groups


def projection_without(
    fitted: Fitted, names: Sequence[str]
) -> tuple[Projection, list[list[int]], FloatArray]:
    """Prepare what was fitted, some of its unknowns not projected out; return their columns, (n_name, n_row), too.

    At the fit these columns gain nothing, but where each group has sizes of its own they may.
    """
    about = fitted.about
    weighted = fitted.problem.weighted(fitted.point, about.weights)
    folds, groups, first = list[slice](), list[list[int]](), 0
    for own in weighted:
        for experiments in own:
            groups.append([])
            for rows in experiments:
                groups[-1].append(len(folds))
                folds.append(slice(first, first + len(rows)))
                first += len(rows)
    residual = np.concatenate([own.ravel() for own in weighted])
    pull = fitted.point / fitted.problem.prior**2
    rows = np.concatenate(about.rows)
    apart = [fitted.problem.free.names.index(name) for name in names]
    kept = np.setdiff1d(np.arange(rows.shape[1]), apart)
    projection = Projection(rows[:, kept], residual, about.whole[np.ix_(kept, kept)], pull[kept], folds)
    return projection, groups, rows[:, apart].T
