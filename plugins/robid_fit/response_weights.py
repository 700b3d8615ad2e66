"""Weights of the logarithm of a response: covariance of the measurement, and one relative error of the model.

Both are taken relative to the model's response once there is one: relative to the measured one, an entry that came out
small by chance would count less than its neighbours, and the fit would lean upwards.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robid_core import BoolArray, ComplexArray, FloatArray, Frf

# Entries noisier than this carry a biased logarithm (E1(SNR)/2: 0.2 % at 6 dB, 11 % at 0 dB).
LOWEST_SIGNAL_TO_NOISE = 4.0
NO_WEIGHT = 1e6  # variance of the logarithm of an entry that is not used
UNCOUPLED = 1e-9  # of the diagonal's size: responses of axes that do not act on one another, and rounding


def covariance_of_logarithm(
    frf: Frf, used: BoolArray, response: ComplexArray, model_error: float, coupling_share: float
) -> ComplexArray:
    """Covariance of log vec(G) on every used line, entries lost in noise taken out.

    Parameters
    ----------
    frf
        The measurement; without a covariance the model's error alone counts.
    used
        Lines, shape (n_config, n_freq).
    response
        What errors are relative to, shape (n_config, n_freq, n_axis, n_axis).
    model_error, coupling_share
        As for `log_covariance`.

    Returns
    -------
    Shape (n_config, n_freq, n_entry, n_entry), zeros on other lines.
    """
    n_config, n_freq, n_axis, _ = response.shape
    n_entry = n_axis * n_axis
    result = np.zeros((n_config, n_freq, n_entry, n_entry), dtype=np.complex128)
    index = np.arange(n_entry)
    for c, lines in enumerate(used):
        noise = result[c, lines]
        if frf.has_covariance:
            noise = frf.covariance(c)[lines]
        if frf.has_covariance and frf.degrees_of_freedom is not None:
            noise = noise * inverse_excess(frf.degrees_of_freedom[c, lines], n_axis)
        weights = log_covariance(response[c, lines], noise, model_error, coupling_share)
        lost = np.einsum("fee->fe", weights).real > 1 / LOWEST_SIGNAL_TO_NOISE
        weights[:, index, index] += np.where(lost, NO_WEIGHT, 0.0)
        result[c, lines] = weights
    return result


def inverse_excess(degrees_of_freedom: FloatArray, n_out: int) -> FloatArray:
    """Factor by which the inverse of an estimated covariance is too large on average, shape (n, 1, 1).

    The inverse of a complex Wishart matrix of nu degrees of freedom is on average ``nu / (nu - n_out)`` times the
    inverse of the covariance (P. Shaman, 1980). Weights of a covariance without this factor show a misfit of a right
    model above one: 1.25 for one axis and five degrees of freedom. With fewer than ``n_out + 1`` there is no mean, and
    the factor is the one of ``n_out + 1``.

    Parameters
    ----------
    degrees_of_freedom
        Complex ones, of each line, shape (n,).
    n_out
        Outputs of the response.
    """
    freedom = np.maximum(degrees_of_freedom, n_out + 1.0)
    factor: FloatArray = freedom / (freedom - n_out)
    return factor[:, None, None]


def log_covariance(
    response: ComplexArray, covariance: ComplexArray, model_error: float, coupling_share: float
) -> ComplexArray:
    """Covariance of log vec(G): measurement, divided by the response, plus the model's own error.

    The model error of entry (i, j) has the standard deviation ``model_error * sqrt(|g_ij|^2 + share^2 |g_ii g_jj|)``:
    relative to the entry, but at an antiresonance relative to its neighbours on the diagonal, since what the
    linear model leaves out does not vanish where the entry does.

    Parameters
    ----------
    response
        Response that the logarithm is taken of, shape (n_freq, n_axis, n_axis).
    covariance
        Covariance of vec(G), shape (n_freq, n_entry, n_entry).
    model_error, coupling_share
        See above, dimensionless.
    """
    g = stacked(with_floor(response))
    floor = stacked(diagonal_size(response))
    relative = covariance / (g[:, :, None] * g[:, None, :].conj())
    variance = model_error**2 * (1 + (coupling_share * floor / np.abs(g)) ** 2)
    index = np.arange(g.shape[1])
    relative[:, index, index] += variance
    return relative


def diagonal_size(response: ComplexArray) -> FloatArray:
    """``sqrt(|g_ii g_jj|)``, the size that entries off the diagonal have beside it; shape of the response."""
    diagonal = np.sqrt(np.abs(np.einsum("...ii->...i", response)))
    result: FloatArray = diagonal[..., :, None] * diagonal[..., None, :]
    return result


def is_uncoupled(response: ComplexArray) -> BoolArray:
    """Entries by which no axis acts on another (a gantry has such): they have no logarithm. Shape of the response."""
    return np.abs(response) < UNCOUPLED * diagonal_size(response)


def with_floor(response: ComplexArray) -> ComplexArray:
    """Return a response (..., n_axis, n_axis) whose uncoupled entries are small in place of zero."""
    result: ComplexArray = np.where(is_uncoupled(response), UNCOUPLED * diagonal_size(response), response)
    return result


def stacked(matrix: npt.NDArray[np.generic]) -> ComplexArray:
    """Columns one below the other, vec(G): entry (i, j) of the last two axes stands at j * n + i."""
    swapped = np.swapaxes(matrix, -1, -2)
    result: ComplexArray = swapped.reshape(*matrix.shape[:-2], -1)
    return result
