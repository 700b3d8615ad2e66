"""Covariance of a local response from the residuals of its window, factored as `artifacts.frf` stores it.

The residuals are those of the *equations*, ``e = D(t) y - N(t) u``, which at the line itself, where D = I, are
those of the output (thesis eq. 3.32, 3.33; (3.32) is the transpose of C_V). They differ in size over the
window: torque disturbances enter as ``N(t) n``, output noise as ``D(t) v``, and least squares makes D small
where there are many lines, which at the ends of the band is everywhere but at the line itself. So each
residual is compared with its expected size, and each reaches G with the size that belongs to its line. To
entries of G they come through the pseudo-inverse of the regressors; the Kronecker product nearest to the
covariance of all entries is stated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.response.local.rational import Solution
from robid_core.estimation.response.local.result import polynomial

EPSILON = np.finfo(np.float64).eps


def residual_products(error: ComplexArray, output: ComplexArray, freedom: FloatArray) -> ComplexArray:
    """``S[i, k] = sum e_i conj(e_k) / freedom`` over the rows of a window, with a floor for rounding errors.

    Parameters
    ----------
    error, output
        Residuals of the equations and outputs, (n, row, n_out).
    freedom
        Complex degrees of freedom, positive, (n,).

    Returns
    -------
    Shape (n, n_out, n_out), positive definite if there are as many degrees of freedom as outputs.
    """
    products = error.swapaxes(-1, -2) @ error.conj()
    return with_floor(products, np.mean(np.abs(output) ** 2, axis=1), freedom)


def with_floor(products: ComplexArray, power: FloatArray, freedom: FloatArray) -> ComplexArray:
    """Residual products over degrees of freedom; rounding errors of outputs of `power` (n, n_out) added."""
    diagonal = np.arange(products.shape[-1])
    products = 0.5 * (products + products.conj().swapaxes(-1, -2))
    rounding = freedom[:, None] * np.maximum((8 * EPSILON) ** 2 * power, np.finfo(np.float64).tiny ** 0.5)
    products[:, diagonal, diagonal] = products[:, diagonal, diagonal].real * (1 + 1e-12) + rounding
    result: ComplexArray = products / freedom[:, None, None]
    return result


@dataclass(frozen=True)
class Course:
    """Expected residuals of windows for disturbances of unit level.

    `parts` (n, w, n_out, n_level) is the variance of the equations' error at each line of a window; `mean`
    (n, n_out, n_level) its expectation in the products `S`: the mean over rows, each counted less as the fit
    follows it.
    """

    parts: FloatArray
    mean: FloatArray


def course(
    numerator: ComplexArray,
    denominator: ComplexArray,
    offset: FloatArray,
    relative_frequency: FloatArray,
    free: FloatArray,
    products: ComplexArray,
    n_out: int,
    weight: FloatArray | None = None,
) -> Course:
    """Expected course of torque disturbances (through N), of position noise and of acceleration noise (through D).

    Parameters
    ----------
    numerator, denominator
        Coefficients (n, order + 1, n_out, n_in) and (n, order + 1, n_out, n_out).
    offset, relative_frequency
        Local variable (n, w), and frequency of the windows' centres (n,) over any fixed one: position noise
        grows with its fourth power from window to window; within a window that is left out.
    free
        What the fit leaves of each line's errors, one less the leverage, summed over experiments and divided by the
        degrees of freedom, zero for lines that fill up; (n, w, 1 or n_out).
    products
        S, (n, n_out, n_out): how the noise of the outputs hangs together. In a loop some combinations of outputs
        have none, and D may then be anything along these.
    n_out
        Outputs of G. What is fitted beyond them are inputs (joint approach): a torque disturbance reaches those as
        the reference does, or by way of the output and the controller, with levels of their own.
    weight
        What squares of the errors are multiplied by, (n, w, n_out), where equations are weighted.
    """

    values = polynomial(numerator, offset)
    through = values.real**2 + values.imag**2
    d = polynomial(denominator, offset)
    diagonal = np.einsum("nii->ni", products).real[:, None, :]
    direct = np.einsum("nwij,nwij->nwi", d @ products[:, None], d.conj()).real / diagonal
    parts = by_origin(through, direct, relative_frequency, n_out)
    if weight is not None:
        parts = parts * weight[..., None]
    return Course(parts, np.einsum("nwi,nwij->nij", np.broadcast_to(free, parts.shape[:3]), parts))


def by_origin(
    through: FloatArray, direct: FloatArray, relative_frequency: FloatArray, n_out: int
) -> FloatArray:
    """Sizes by origin along a last axis: torque disturbances, position noise, acceleration noise.

    `through` (n, w, n_fitted, n_in) are squares of N, `direct` (n, w, n_fitted) sizes of output noise relative to the
    centre; w counts lines or powers of the local variable. For the rest see `course`.
    """
    if n_out < through.shape[2]:
        none = np.zeros_like(through)
        outputs, inputs, fed_back = none.copy(), none.copy(), none
        outputs[:, :, :n_out], inputs[:, :, n_out:] = through[:, :, :n_out], through[:, :, n_out:]
        axes = min(n_out, through.shape[2] - n_out)
        fed_back[:, :, n_out : n_out + axes] = through[:, :, :axes]
        through = np.concatenate((outputs, inputs, fed_back), axis=-1)
    own = direct[..., None] * np.eye(direct.shape[-1])
    grows = own * relative_frequency[:, None, None, None] ** 4
    result: FloatArray = np.concatenate((through, grows, own), axis=-1)
    return result


def disturbance_levels(power: FloatArray, mean: FloatArray, valid: BoolArray) -> FloatArray:
    """Levels, none negative, that make the residual powers of all lines most likely.

    By multiplicative updates for the Itakura-Saito divergence, as `estimation.covariance.residual_shape`.

    Parameters
    ----------
    power
        Diagonal of S, positive, (n_freq, n_out).
    mean
        Of `Course`, (n_freq, n_out, n_level).
    valid
        Lines that count, (n_freq,).
    """
    power, mean = power[valid], mean[valid]
    total = mean.sum(axis=(0, 1))
    used = total > 0
    level = np.where(used, power.sum() / np.where(used, total, 1.0) / max(1, used.sum()), 0.0)
    for _ in range(100):
        expected = mean @ level
        weight = 1.0 / expected
        up = np.einsum("fij,fi->j", mean, power * weight**2)
        down = np.einsum("fij,fi->j", mean, weight)
        level = level * np.where(used, up / np.where(used, down, 1.0), 0.0)
        level = np.where(level > 1e-12 * level[used].max(initial=0.0), level, 0.0)
    result: FloatArray = level
    return result


def error_deviation(window: Course, level: FloatArray) -> FloatArray:
    """How much larger an error at a line of the window is than the mean that S shows, (n, w, n_out)."""
    expected = window.mean @ level
    relative = (window.parts @ level) / np.where(expected > 0, expected, 1.0)[:, None, :]
    result: FloatArray = np.sqrt(relative)
    return result


def dense_covariance(solution: Solution, products: ComplexArray, deviation: FloatArray) -> ComplexArray:
    """Covariance of all entries, ``C[i, j, k, l] = E[dG_ij conj(dG_kl)]``, errors of rows independent.

    An error of row r has covariance ``s_r S s_r`` with the diagonal matrix s_r of `deviation` at its line.

    Parameters
    ----------
    solution
        Of n windows.
    products
        S, (n, n_out, n_out).
    deviation
        (n, w, n_out).

    Returns
    -------
    Shape (n, n_out, n_in, n_out, n_in).
    """
    n, w, n_out = deviation.shape
    own = solution.influence
    n_in, n_row = own.shape[2:]
    by_row = np.repeat(deviation, n_row // w, axis=1).swapaxes(-1, -2)  # (n, n_out, row)
    scaled = own * by_row[:, :, None, :]
    flat = scaled.reshape(n, n_out * n_in, n_row)
    gram = (flat @ flat.conj().swapaxes(-1, -2)).reshape(n, n_out, n_in, n_out, n_in)
    dense: ComplexArray = gram * products[:, :, None, :, None]
    if solution.coupling is None or solution.pull is None:
        return dense
    # A common denominator carries every error to every entry: its own scatter, and how that goes with the rest's.
    pull = solution.pull * by_row.swapaxes(-1, -2)[:, None]
    through = np.moveaxis(solution.coupling, 1, -1).reshape(n, n_out * n_in, -1)
    pulled = pull @ products[:, None]
    n_power = pull.shape[1]
    scatter = pulled.reshape(n, n_power, -1) @ pull.reshape(n, n_power, -1).conj().swapaxes(-1, -2)
    joint = np.moveaxis(pulled, -1, 1) @ scaled.conj().swapaxes(-1, -2)  # (n, n_out, power, n_in)
    cross = through @ np.moveaxis(joint, 1, 2).reshape(n, n_power, -1)
    common = through @ scatter @ through.conj().swapaxes(-1, -2) + cross + cross.conj().swapaxes(-1, -2)
    return dense + common.reshape(dense.shape)


def nearest_product(
    dense: ComplexArray, output_covariance: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Factor pair (gram inverse, output covariance) whose product is nearest to a covariance of all entries.

    Nearest in the sense of Kullback and Leibler among circular Gaussian distributions, by turns: the one factor that
    is best for the other (P. Dutilleul, 1999). Positive definite where `dense` is, and independent of units. Of the
    free scale, `output_covariance` keeps its determinant.

    Parameters
    ----------
    dense
        Shape (n, n_out, n_in, n_out, n_in), as `dense_covariance` gives it.
    output_covariance
        Covariance of the output's error at the line itself, where it starts, (n, n_out, n_out).
    """
    n_out, n_in = dense.shape[1:3]
    c = output_covariance
    gram = np.empty(())
    for _ in range(5):  # each turn a small fraction of the last change; the start is close
        gram = np.einsum("nijkl,nki->njl", dense, np.linalg.inv(c)) / n_out
        gram = 0.5 * (gram + gram.conj().swapaxes(-1, -2))
        c = np.einsum("nijkl,nlj->nik", dense, np.linalg.inv(gram)) / n_in
        c = 0.5 * (c + c.conj().swapaxes(-1, -2))
    scale = np.exp((np.linalg.slogdet(output_covariance)[1] - np.linalg.slogdet(c)[1]) / n_out)[:, None, None]
    return gram.conj() / scale, c * scale
