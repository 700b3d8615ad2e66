"""Covariance where all outputs have the same regressors: the full matrix fraction and the polynomial.

Then ``dG[i, j] = sum_r a_r[j] e_r[i]``, and the expected course of the errors is a polynomial in the local
variable, so that moments of the a_r are all that is needed: nothing of the size of the data. As `covariance`
otherwise, but for this: the Kronecker product is fitted to each output's own part, and the outputs'
correlation is that of the residuals.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.response.local.covariance import by_origin, disturbance_levels


def common_factors(
    numerator: ComplexArray,
    denominator: ComplexArray,
    products: ComplexArray,
    influence: ComplexArray,
    free: FloatArray,
    relative_frequency: FloatArray,
    valid: BoolArray,
    n_out: int,
) -> tuple[ComplexArray, ComplexArray]:
    """Factors (gram inverse, output covariance) of the fitted response at all lines; see `artifacts.frf`.

    Parameters
    ----------
    numerator, denominator
        Coefficients (n_freq, order + 1, n_fitted, n_in) and (n_freq, order + 1, n_fitted, n_fitted).
    products
        S, residual products over degrees of freedom, (n_freq, n_fitted, n_fitted).
    influence
        ``sum_r t^m a_r a_r^H``, (n_freq, n_moment, n_in, n_in), of at least twice the order moments.
    free
        ``sum_r t^m (1 - leverage)`` over degrees of freedom, (n_freq, n_moment).
    relative_frequency, valid
        Of the lines, over any fixed frequency; and which count.
    n_out
        Outputs of G among those fitted; see `covariance.course`.

    Returns
    -------
    Shapes (n_freq, n_in, n_in) and (n_freq, n_fitted, n_fitted); of lines that are not valid nothing worth using.
    """
    n_freq, n_moment, n_in = influence.shape[:3]
    n_fitted = products.shape[1]
    used = valid[:, None, None]
    s = np.where(used, products, np.eye(n_fitted))
    numerator, denominator = (np.where(used[..., None], x, 0.0) for x in (numerator, denominator))
    diagonal = np.einsum("fii->fi", s).real
    through = np.zeros((n_freq, n_moment, n_fitted, n_in))
    direct = np.zeros((n_freq, n_moment, n_fitted))
    for coefficients, squares in ((numerator, through), (denominator, direct)):
        for first in range(coefficients.shape[1]):
            for second in range(coefficients.shape[1]):
                a, b = coefficients[:, first], coefficients[:, second].conj()
                if squares is through:
                    through[:, first + second] += (a * b).real
                else:
                    direct[:, first + second] += np.einsum("fij,fij->fi", a @ s, b).real / diagonal
    direct[~valid, 0] = 1.0
    parts = by_origin(through, direct, relative_frequency, n_out)
    mean = np.einsum("fm,fmil->fil", np.where(valid[:, None], free, 1.0), parts)
    level = disturbance_levels(diagonal, mean, valid)
    expected = mean @ level
    course = (parts @ level) / np.where(expected > 0, expected, 1.0)[
        :, None, :
    ]  # (n_freq, n_moment, n_fitted)
    course[~valid] = np.eye(n_moment)[0][:, None]
    influence = np.where(used[..., None], influence, np.eye(n_in))
    by_output = np.einsum("fmi,fmjl->fijl", course, influence) * diagonal[:, :, None, None]
    scale = np.sqrt(course[:, 0])
    covariance = s * scale[:, :, None] * scale[:, None, :]
    variance = np.einsum("fii->fi", covariance).real
    for _ in range(5):  # by turns: the gram matrix for the variances, and these for it
        gram = np.mean(by_output / variance[:, :, None, None], axis=1)
        inverse = np.linalg.inv(gram)
        variance = np.einsum("fjl,filj->fi", inverse, by_output).real / n_in
    ratio = np.sqrt(variance / np.einsum("fii->fi", covariance).real)
    size = np.exp(np.mean(np.log(ratio), axis=1))[:, None, None]  # the determinant stays that at the line
    covariance = covariance * (ratio / size[:, 0])[:, :, None] * (ratio / size[:, 0])[:, None, :]
    return gram.conj() * size**2, covariance
