"""Residuals of data that a fit did not see: each configuration left out in turn, the rest fitted by one step.

About its minimum a fit without some rows is one Gauss-Newton step away: with precision matrix H, the rows' own share M
and their gradient g (derivatives times residual), the unknowns move by ``-(H - M)^-1 g``, and the rows' residual grows
by their derivatives times that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import ComplexArray, FloatArray
from robid_core.residual import Weighting
from robid_diagnosis.hypothesis import Fitted

FAR = 0.5  # of a parameter, in natural scales: a step that goes farther is no step of Gauss and Newton


def held_out_residuals(fitted: Fitted) -> list[ComplexArray] | None:
    """Measured less predicted torque of each block, N m, (n_config, n_exp, n_bin, n_axis), as if it was not fitted.

    Configurations are left out; experiments, where there is but one. None where the rest would be fitted so differently
    that one step does not tell it.
    """
    problem, about = fitted.problem, fitted.about
    weighted = problem.weighted(fitted.point, about.weights)
    alone = len(about.rows) == 1
    found, group = [], 0
    for own, weighting in zip(weighted, about.weights, strict=True):
        left = np.empty_like(own)
        for c, residual in enumerate(own):
            rows = about.rows[group].reshape(*residual.shape, -1)
            parts = range(len(residual)) if alone else [slice(None)]
            for part in parts:
                left[c, part], step = left_out(rows[part], residual[part], about.whole)
                if (np.abs(step[: problem.n_free]) > FAR).any():
                    return None
            group += 1
        found.append(unweighted(weighting, left))
    return with_unused(found, about.weights, problem.residuals(fitted.point))


def with_unused(
    left: Sequence[ComplexArray], weights: Sequence[Weighting], residuals: Sequence[ComplexArray]
) -> list[ComplexArray]:
    """Return spectra of each block with residuals where weights leave experiments out.

    All of shape (n_config, n_exp, n_bin, n_row).
    """
    parts = zip(left, weights, residuals, strict=True)
    return [
        own if weight.used is None else np.where(weight.used[..., None, None], own, residual)
        for own, weight, residual in parts
    ]


def left_out(rows: FloatArray, residual: FloatArray, whole: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residual of some rows as if they were not fitted, and how the unknowns move back, (n_unknown,).

    Parameters
    ----------
    rows
        Derivatives of what is predicted, (..., n_unknown).
    residual
        At the minimum of all rows and priors, (...,).
    whole
        Precision matrix there, (n_unknown, n_unknown).
    """
    flat = rows.reshape(-1, rows.shape[-1])
    step = np.asarray(np.linalg.solve(whole - flat.T @ flat, flat.T @ residual.ravel()), dtype=np.float64)
    grown: FloatArray = residual + rows @ step
    return grown, step


def unweighted(weighting: Weighting, rows: FloatArray) -> ComplexArray:
    """Spectra, N m, (n_config, n_exp, n_bin, n_axis), of weighted residuals (n_config, n_exp, n_row)."""
    n_bin, n_axis = weighting.matrix.shape[:2]
    parts = rows.reshape(*rows.shape[:2], 2, n_bin, n_axis)
    white = parts[:, :, 0] + 1j * parts[:, :, 1]
    spectra: ComplexArray = np.linalg.solve(weighting.matrix, white[..., None])[..., 0].astype(np.complex128)
    return spectra
