"""Means of one response matrix per block: harmonic, and logarithmic after (3.12) and (3.13) of the thesis.

The arithmetic mean (3.11) trusts the inputs, the harmonic mean the outputs; the logarithm stands between them:
of matrices, or entry by entry relative to the first block. To first order in the noise all are the same.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.response.eigen import eigen, matrix_function
from robid_core.estimation.response.spectra import CONDITION_LIMIT, factor_inputs


def harmonic_mean(backward: ComplexArray, condition_limit: float = CONDITION_LIMIT) -> ComplexArray:
    """Inverse of the mean of inverse responses, ``(mean_m U_m Y_m^-1)^-1``.

    Parameters
    ----------
    backward
        One inverse response per block, shape (n_block, ..., n_freq, n, n); NaN comes out where one is NaN.
    condition_limit
        A line whose mean has a larger condition number, rows scaled to equal size, gets NaN.
    """
    mean = backward.mean(axis=0)
    usable = np.isfinite(mean).all(axis=(-2, -1))[..., None, None]
    # Rows of zeros where there is nothing to invert: refused by their condition number.
    return factor_inputs(np.where(usable, mean, 0.0), condition_limit).inverse


def logarithmic_mean_matrix(blocks: ComplexArray) -> ComplexArray:
    """Mean of response matrices by their matrix logarithm, ``P^-1 exp(mean_m log(P G_m))`` (3.12).

    ``P = V diag(exp(-i arg lambda)) V^-1`` from the eigenvalues and eigenvectors of the first block (3.13):
    the eigenvalues of ``P G_1`` are real and positive, so that those of the other blocks stay away from the
    cut of the logarithm. The entries of ``P G_1`` are not real; the logarithm entry by entry would be wrong.

    Parameters
    ----------
    blocks
        One response matrix per block, square, shape (n_block, ..., n, n); NaN comes out where one is NaN.
    """
    usable = np.isfinite(blocks).all(axis=(0, -2, -1))
    result = np.full(blocks.shape[1:], np.nan + 0j)
    matrices = blocks[:, usable].astype(np.complex128)
    rotation, back = _rotation(matrices[0])
    logarithm = _matrix_function(rotation @ matrices, np.log).mean(axis=0)
    result[usable] = back @ _matrix_function(logarithm, np.exp)
    return result


def _rotation(matrices: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """P of (3.13) and its inverse; any P will do that is invertible: without eigenvectors it is a scalar one."""
    of = eigen(matrices, condition_limit=1e8)
    turn = np.exp(-1j * np.angle(of.value))
    rotation, back = matrix_function(of, lambda _: turn), matrix_function(of, lambda _: turn.conj())
    dependent = np.isnan(of.inverse).any(axis=(-2, -1))
    scalar = np.exp(-1j * np.angle(of.value[dependent].sum(axis=-1)))[:, None, None]
    identity = np.eye(matrices.shape[-1])
    rotation[dependent], back[dependent] = scalar * identity, scalar.conj() * identity
    return rotation, back


def _matrix_function(matrices: ComplexArray, function: np.ufunc) -> ComplexArray:
    """Primary function (log or exp) of matrices by eigenvectors, or by SciPy where these are dependent."""
    # Eigenvectors of condition kappa cost log10(kappa) digits; measured responses rarely come near this.
    of = eigen(matrices, condition_limit=1e5)
    result = matrix_function(of, function)
    dependent = np.isnan(of.inverse).any(axis=(-2, -1))
    if dependent.any():
        from scipy.linalg import expm, logm

        for where in map(tuple, np.argwhere(dependent)):
            result[where] = logm(matrices[where]) if function is np.log else expm(matrices[where])
    return result


def logarithmic_mean_entries(blocks: ComplexArray, deviation: FloatArray | None = None) -> ComplexArray:
    """Mean of responses by the logarithm of each entry relative to the first block.

    ``g = g_1 exp(mean_m log(g_m / g_1))``: the mean of the logarithmic amplitudes and of the phases, which
    are counted from the first block's and so need no unwrapping over frequency. In noise of signal-to-noise
    ratio S (power) the logarithm of the amplitude is too large by ``E1(S) / 2``: 0.2 % at 6 dB, 11 % at 0 dB,
    and an entry that is zero by symmetry comes out as the size of its noise with any phase. Entries below
    6 dB in a block therefore take the arithmetic mean, which is unbiased.

    Parameters
    ----------
    blocks
        One response per block, shape (n_block, ...).
    deviation
        Standard deviation of each entry of *one block* (complex: of real and imaginary part together), shape
        of one block; None where it is not known, and then only entries with an exact zero are treated so.
    """
    arithmetic: ComplexArray = blocks.mean(axis=0)
    noisy = (~np.isfinite(blocks) | (blocks == 0)).any(axis=0)
    if deviation is not None:
        noisy |= np.abs(arithmetic) < 2.0 * deviation  # 6 dB
    safe = np.where(noisy, 1.0, blocks)
    mean: ComplexArray = safe[0] * np.exp(np.log(safe / safe[0]).mean(axis=0))
    return np.where(noisy, arithmetic, mean)
