"""Standard errors that cover: a jackknife over configurations, steadied by the formal covariance.

Residuals of a grey-box fit are not independent from line to line: what the linear model leaves out is smooth
in frequency and common to a configuration. The formal covariance (inverse Gauss-Newton matrix) is then too
small. Leaving out one configuration at a time shows the real scatter, but from few groups it is noisy for any
single parameter. So the formal covariance is first inflated by the average ratio of the two, and then each
parameter's own ratio is shrunk toward that average, as in empirical Bayes estimation of variances (Smyth 2004).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import FloatArray

# Weight of the common ratio, in degrees of freedom, against the n_group - 1 of a parameter's own ratio.
PRIOR_DEGREES_OF_FREEDOM = 4.0
ALONE = 16.0  # of a variance: a group without which it grows by more is all that tells the parameter


def jackknife_shifts(gauss_newton: FloatArray, gradients: FloatArray, matrices: FloatArray) -> FloatArray:
    """One-step estimates of how the minimum moves when a group of residuals is left out.

    Parameters
    ----------
    gauss_newton
        Sum of J^T J over all groups, shape (n, n).
    gradients
        J^T r of each group at the minimum, shape (n_group, n); they sum to zero there.
    matrices
        J^T J of each group, shape (n_group, n, n).

    Returns
    -------
    Shift of the minimum without group g, shape (n_group, n). Of a parameter that this group alone tells it is zero:
    what the others would say instead is no error of the model.
    """
    scale = np.sqrt(np.diag(gauss_newton))
    inverse = np.linalg.pinv((gauss_newton - matrices) / np.outer(scale, scale), rcond=1e-10)
    shifts: FloatArray = np.einsum("gij,gj->gi", inverse, gradients / scale) / scale
    whole = np.diag(np.linalg.pinv(gauss_newton / np.outer(scale, scale), rcond=1e-10))
    without = np.diagonal(inverse, axis1=1, axis2=2)
    return np.where(without > ALONE * whole, 0.0, shifts)


def covariance_with_model_error(
    formal: FloatArray, shifts: FloatArray, common: float | None = None
) -> FloatArray:
    """Covariance of parameters from the formal one and from leave-one-group-out shifts.

    Parameters
    ----------
    formal
        Inverse Gauss-Newton matrix, shape (n, n).
    shifts
        From `jackknife_shifts`, shape (n_group, n), n_group >= 2.
    common
        Ratio that each parameter's own is shrunk toward; None: the mean of all.

    Returns
    -------
    Covariance, shape (n, n), with the correlations of the formal one; never below it.
    """
    ratio = _ratios(formal, shifts)
    own = len(shifts) - 1.0
    common = float(ratio.mean()) if common is None else common
    inflation = (PRIOR_DEGREES_OF_FREEDOM * common + own * ratio) / (PRIOR_DEGREES_OF_FREEDOM + own)
    root = np.sqrt(np.maximum(inflation, 1.0))
    widened: FloatArray = formal * np.outer(root, root)
    return widened


def covariance_of_curves(
    formal: FloatArray,
    gauss_newton: FloatArray,
    gradients: FloatArray,
    matrices: FloatArray,
    curves: Sequence[Sequence[int]],
) -> FloatArray:
    """Covariance as by `covariance_with_model_error`, where parameters are sizes of functions that make curves.

    Such sizes may be large against one another; what matters is their sum. Ratios are therefore those of uncorrelated
    sums of them: other ratios for single ones would tear the curve apart.

    Parameters
    ----------
    formal
        Inverse Gauss-Newton matrix, shape (n, n).
    gauss_newton, gradients, matrices
        As of `jackknife_shifts`.
    curves
        Numbers of the parameters that make a curve each.
    """
    common = float(_ratios(formal, jackknife_shifts(gauss_newton, gradients, matrices)).mean())
    sums, back = _uncorrelated(formal, curves)
    shifts = jackknife_shifts(back.T @ gauss_newton @ back, gradients @ back, back.T @ matrices @ back)
    covariance = covariance_with_model_error(sums @ formal @ sums.T, shifts, common)
    return back @ covariance @ back.T


def _ratios(formal: FloatArray, shifts: FloatArray) -> FloatArray:
    """Variance by the jackknife over the formal one, (n,)."""
    centred = shifts - shifts.mean(axis=0)
    jackknife = (len(shifts) - 1) / len(shifts) * (centred**2).sum(axis=0)
    ratio: FloatArray = jackknife / np.diag(formal)
    return ratio


def _uncorrelated(formal: FloatArray, curves: Sequence[Sequence[int]]) -> tuple[FloatArray, FloatArray]:
    """Return a matrix of sums of parameters that are uncorrelated within a curve, and its inverse, (n, n) each."""
    sums, back = np.eye(len(formal)), np.eye(len(formal))
    for curve in curves:
        place = np.ix_(curve, curve)
        scale = np.sqrt(np.diag(formal)[curve])
        _, vectors = np.linalg.eigh(formal[place] / np.outer(scale, scale))
        sums[place] = vectors.T / scale
        back[place] = scale[:, None] * vectors
    return sums, back
