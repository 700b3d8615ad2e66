"""Covariance of a measured response matrix, with full rank from few experiments.

A covariance of the 36 entries of a 6 x 6 response, taken from the scatter of M blocks, has rank M - 1. Here
it is built as ``(U U^H)^-T (x) C_V`` (vec by columns): the inputs are known, and only the n_out x n_out
covariance ``C_V`` of the residuals ``Y - G U`` of one experiment has to be estimated. It is pooled over all
experiments of all blocks and over neighbouring lines, and then has full rank and known degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray


@dataclass(frozen=True)
class Pooled:
    """Covariance per line and the complex degrees of freedom behind it.

    `covariance` (n_config, n_freq, n_out, n_out) is positive definite on valid lines and NaN elsewhere;
    `degrees_of_freedom` (n_config, n_freq) is zero there. `half_window` counts the neighbours on either side.
    """

    covariance: ComplexArray
    degrees_of_freedom: FloatArray
    half_window: int


def residual_products(u: ComplexArray, y: ComplexArray, inverse: ComplexArray) -> ComplexArray:
    """``V V^H`` of the least-squares residuals ``V = Y (I - U^+ U)`` at each line.

    Their expectation is ``(n_exp - n_in) C_V``, whatever the inputs, and they are independent of the
    least-squares response; total scatter, noise and the distortion of a nonlinear robot alike.

    Parameters
    ----------
    u, y
        Spectra of all experiments, shapes (..., n_freq, n_in, n_exp) and (..., n_freq, n_out, n_exp).
    inverse
        ``U^+``, shape (..., n_freq, n_exp, n_in).

    Returns
    -------
    Shape (..., n_freq, n_out, n_out).
    """
    residual = y - (y @ inverse) @ u
    return residual @ residual.conj().swapaxes(-1, -2)


def block_products(blocks: ComplexArray, gram_inverse: ComplexArray) -> ComplexArray:
    """``sum_m (G_m - mean) S_m (G_m - mean)^H`` of block responses, scaled to count for (M - 1) n_in C_V.

    For block responses with covariance ``S_m^-T (x) C_V``, ``S_m = U_m U_m^H``, the expectation of the sum
    is d times C_V with ``d = (M - 2) n_in + sum_{m,k} tr(S_k^-1 S_m) / M^2``; for equal blocks d is
    (M - 1) n_in, and for others the sum is scaled to it. Unlike `residual_products` this needs nothing of how
    the block responses were made.

    Parameters
    ----------
    blocks
        Shape (n_block, ..., n_out, n_in).
    gram_inverse
        ``S_m^-1`` of each block, shape (n_block, ..., n_in, n_in), finite.

    Returns
    -------
    Shape (..., n_out, n_out).
    """
    n_block, n_in = blocks.shape[0], blocks.shape[-1]
    gram = np.linalg.inv(gram_inverse)
    deviation = blocks - blocks.mean(axis=0)
    products = (deviation @ gram @ deviation.conj().swapaxes(-1, -2)).sum(axis=0)
    trace = np.einsum("...ij,...ji->...", gram_inverse.sum(axis=0), gram.sum(axis=0)).real
    counts_for = (n_block - 2) * n_in + trace / n_block**2
    result: ComplexArray = products * ((n_block - 1) * n_in / counts_for)[..., None, None]
    return result


def period_products(u: ComplexArray, y: ComplexArray, response: ComplexArray) -> ComplexArray:
    """Products of the differences between periods: noise alone, for everything periodic cancels.

    With ``v_p = Y_p - G U_p`` of period p, ``sum (v_p - mean)(v_p - mean)^H / P`` over periods and
    experiments; its expectation is ``(P - 1) n_exp`` times the noise part of C_V for the period *average*.

    Parameters
    ----------
    u, y
        Spectra of each period, shapes (..., n_freq, n_in, n_exp, n_period) and (..., n_out, n_exp, n_period).
    response
        G, shape (..., n_freq, n_out, n_in).
    """
    return difference_products(y - np.einsum("...ij,...jep->...iep", response, u))


def difference_products(error: ComplexArray) -> ComplexArray:
    """Products of the differences between periods of any signals, as `period_products` counts them.

    Takes shape (..., n_signal, n_exp, n_period), returns (..., n_signal, n_signal).
    """
    error = error - error.mean(axis=-1, keepdims=True)
    flat = error.reshape(*error.shape[:-2], -1)
    result: ComplexArray = flat @ flat.conj().swapaxes(-1, -2) / error.shape[-1]
    return result


def gram_inverse_of_mean(gram_inverse: ComplexArray) -> ComplexArray:
    """Inverse Gram matrix that belongs to the mean of block responses, ``sum_m S_m^-1 / M^2``.

    To first order in the noise the logarithmic mean is the arithmetic mean of the blocks, so it has the
    covariance ``(sum_m S_m^-1 / M^2)^T (x) C_V``. With equal blocks this is ``(sum_m S_m)^-1``, as for H1.

    Takes shape (n_block, ..., n_in, n_in), returns (..., n_in, n_in).
    """
    result: ComplexArray = gram_inverse.sum(axis=0) / gram_inverse.shape[0] ** 2
    return result


def default_half_window(weight_per_line: int, n_out: int) -> int:
    """Neighbours on either side so that the degrees of freedom reach four times the number of outputs.

    At least two. A covariance from as many residuals as outputs is singular in practice; its inverse, which
    weights the fit, is too large by nu / (nu - n_out) on average: a third at four times.
    """
    if weight_per_line <= 0:
        return 2
    return max(2, int(np.ceil((4 * n_out / weight_per_line - 1) / 2)))


def residual_shape(
    power: FloatArray, valid: BoolArray, response: ComplexArray, frequency_hz: FloatArray
) -> ComplexArray:
    """How the residuals' covariance goes with frequency: ``G diag(a) G^H + w^4 diag(b)``.

    Friction, ripple and torque noise enter as torques with a smooth spectrum and reach the residual through
    the response, with its resonances; noise of the measured position enters as acceleration, like w^4. The
    levels a (one per input) and b (one per output), none negative, make the exponentially distributed powers
    most likely; found by multiplicative updates (C. Fevotte, N. Bertin and J.-L. Durrieu, 2009, for the
    Itakura-Saito divergence).

    Parameters
    ----------
    power
        Mean of |V|^2 per line and output, positive, shape (n_config, n_freq, n_out).
    valid
        Lines that count, shape (n_config, n_freq), some in each configuration.
    response
        G, finite, shape (n_config, n_freq, n_out, n_in).
    frequency_hz
        Shape (n_freq,).

    Returns
    -------
    Shape (n_config, n_freq, n_out, n_out), positive definite; only its course over the lines is used.
    """
    n_out, n_in = response.shape[-2:]
    used = valid[..., None]
    through = np.abs(response) ** 2
    direct = (frequency_hz[:, None] / frequency_hz.max()) ** 4
    # Equal shares to begin with.
    b = 0.5 * (used * power).sum(axis=1) / (used * direct).sum(axis=1)
    level = (used * power).sum(axis=(1, 2)) / (used[..., None] * through).sum(axis=(1, 2, 3))
    a = np.tile(0.5 * level[:, None], n_in)
    for _ in range(100):
        expected = np.einsum("ckij,cj->cki", through, a) + direct * b[:, None]
        weight = used / expected
        ratio = weight * power / expected
        a = a * np.einsum("cki,ckij->cj", ratio, through) / np.einsum("cki,ckij->cj", weight, through)
        b = b * (ratio * direct).sum(axis=1) / (weight * direct).sum(axis=1)
    shape: ComplexArray = (response * a[:, None, None, :]) @ response.conj().swapaxes(-1, -2)
    diagonal = np.arange(n_out)
    # A millionth of the diagonal keeps it invertible where the response is singular.
    shape[..., diagonal, diagonal] = shape[..., diagonal, diagonal].real * (1 + 1e-6) + direct * b[:, None]
    return shape


def pool_lines(
    products: ComplexArray,
    weight: int,
    valid: BoolArray,
    power: FloatArray,
    response: ComplexArray,
    frequency_hz: FloatArray,
    half_window: int | None = None,
) -> Pooled | None:
    """Covariance from the residual products of each line and its nearest valid neighbours.

    Around a resonance the residuals change by orders of magnitude from line to line; so they are divided by
    their expected course (`residual_shape`), pooled, and multiplied by it again. The window holds the same
    number of valid lines everywhere: at the ends of the band it leans inward, and masked lines are stepped
    over. Rounding errors of the spectra are added, so that data without noise give a positive definite
    matrix too.

    Parameters
    ----------
    products
        ``V V^H`` of each line, shape (n_config, n_freq, n_out, n_out).
    weight
        Complex degrees of freedom in each of them.
    valid
        Lines to use, shape (n_config, n_freq).
    power
        Mean of |Y|^2 over the experiments, shape (n_config, n_freq, n_out): the scale of rounding errors.
    response, frequency_hz
        For the expected course, shapes (n_config, n_freq, n_out, n_in) and (n_freq,).
    half_window
        Neighbours on either side; None takes `default_half_window`.

    Returns
    -------
    None where all valid lines of some configuration together have fewer degrees of freedom than there are
    outputs: no covariance of full rank can be stated then.
    """
    n_out, diagonal = power.shape[-1], np.arange(power.shape[-1])
    half = default_half_window(weight, n_out) if half_window is None else half_window
    if min(2 * half + 1, int(valid.sum(axis=1).min())) * weight < n_out:
        return None
    # Masked lines hold NaN: anything finite will do there, they are not looked at.
    epsilon, used = np.finfo(np.float64).eps, valid[..., None, None]
    products = np.where(used, 0.5 * (products + products.conj().swapaxes(-1, -2)), 0)
    rounding = weight * np.maximum((8 * epsilon) ** 2 * power, np.finfo(np.float64).tiny ** 0.5)
    products[..., diagonal, diagonal] = products[..., diagonal, diagonal].real + rounding
    scatter = products[..., diagonal, diagonal].real / weight
    shape = residual_shape(
        scatter, valid, np.where(used, response, np.eye(*response.shape[-2:])), frequency_hz
    )
    root = np.linalg.cholesky(shape)
    inverse = np.linalg.inv(root)
    whitened = inverse @ products @ inverse.conj().swapaxes(-1, -2) / weight
    covariance, freedom = np.full(products.shape, np.nan + 0j), np.zeros(valid.shape)
    for i, lines in enumerate(map(np.flatnonzero, valid)):
        length = min(2 * half + 1, len(lines))
        first = np.clip(np.arange(len(lines)) - half, 0, len(lines) - length)
        pooled = whitened[i, lines[first[:, None] + np.arange(length)]].mean(axis=1)
        # What rounding may have taken from a sum in which two outputs go exactly together.
        pooled[:, diagonal, diagonal] *= 1 + 64 * epsilon * weight * length
        pooled = root[i, lines] @ pooled @ root[i, lines].conj().swapaxes(-1, -2)
        covariance[i, lines] = 0.5 * (pooled + pooled.conj().swapaxes(-1, -2))
        freedom[i, lines] = weight * length
    return Pooled(covariance, freedom, half)


def confidence_radius(
    variance: FloatArray, degrees_of_freedom: FloatArray, level: float = 0.95
) -> FloatArray:
    """Radius of the region that covers a complex entry with probability `level`.

    ``|g - G|^2 <= variance * F``, where F is the quantile of F(2, 2 nu), in closed form
    ``nu ((1 - level)^(-1/nu) - 1)``; 5.14 at nu = 3, where the normal approximation would say 3.00.

    Parameters
    ----------
    variance
        Variance of each entry (real and imaginary part together).
    degrees_of_freedom
        nu, complex, of a shape that broadcasts with `variance`; infinite where the variance is known.
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        factor = degrees_of_freedom * np.expm1(-np.log1p(-level) / degrees_of_freedom)
        factor = np.where(np.isinf(degrees_of_freedom), -np.log1p(-level), factor)
        result: FloatArray = np.sqrt(variance * factor)
    return result
