"""From spectra to the response matrix, line by line: averaging methods of thesis section 3.2.3.

H1 after (3.10), the logarithmic mean after (3.12) and (3.13) and, simpler, entry by entry relative to the
first block. A line is a frequency; column e of U and Y is experiment e. Everything is batched: leading axes
(configurations, blocks) are free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.errors import DataRejected, PoorExcitation

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

CONDITION_LIMIT = 1e6  # half of the digits of a double are gone; measured spectra have fewer


@dataclass(frozen=True)
class InputFactors:
    """What the input matrices of all lines yield once and for all.

    `condition` has shape (..., n_freq) and is infinite where an input matrix has no full rank; there the
    other two are NaN. `inverse` is ``U^+ = U^H (U U^H)^-1``, shape (..., n_freq, n_exp, n_in);
    `gram_inverse` is ``(U U^H)^-1``, shape (..., n_freq, n_in, n_in).
    """

    condition: FloatArray
    inverse: ComplexArray
    gram_inverse: ComplexArray


def factor_inputs(u: ComplexArray, condition_limit: float = CONDITION_LIMIT) -> InputFactors:
    """Condition, pseudo-inverse and inverse Gram matrix of the inputs by one singular value decomposition.

    The rows of U are first divided by each axis' root mean square over all lines, so that the condition
    number does not depend on the units or sizes of the axes, down to 1e-9 of the largest: an axis below that
    moved by rounding errors only. (``U U^H`` is never inverted: that would square the condition number.)

    Parameters
    ----------
    u
        Input spectra, shape (..., n_freq, n_in, n_exp).
    condition_limit
        Lines above it get NaN instead of an inverse.
    """
    n_in, n_exp = u.shape[-2:]
    _refuse_nan("input", u)
    if n_exp < n_in:
        raise PoorExcitation(
            f"{n_exp} experiments cannot separate {n_in} inputs at any line (condition number infinite); "
            f"measure at least {n_in} experiments a block"
        )
    scale = np.sqrt(np.mean(np.abs(u) ** 2, axis=(-3, -1), keepdims=True))
    largest = scale.max(axis=-2, keepdims=True)
    scale = np.maximum(scale, np.where(largest > 0, 1e-9 * largest, 1.0))
    left: ComplexArray
    singular: FloatArray
    right: ComplexArray
    left, singular, right = np.linalg.svd(u / scale, full_matrices=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.where(singular[..., -1] > 0, singular[..., 0] / singular[..., -1], np.inf)
        usable = (condition <= condition_limit)[..., None]
        reciprocal = np.where(usable, 1.0 / singular, np.nan)
    # U = scale A S B^H, hence U^+ = B S^-1 A^H / scale and (U U^H)^-1 = (A S^-1 / scale) (A S^-1 / scale)^H.
    # A row at a time: `scale` belongs to the rows of A, which are the columns of A^H.
    unscaled = left * reciprocal[..., None, :] / scale
    inverse: ComplexArray = right.conj().swapaxes(-1, -2) @ unscaled.conj().swapaxes(-1, -2)
    gram_inverse: ComplexArray = unscaled @ unscaled.conj().swapaxes(-1, -2)
    return InputFactors(condition, inverse, gram_inverse)


def response_from_spectra(
    u: ComplexArray,
    y: ComplexArray,
    frequency_hz: FloatArray | None = None,
    condition_limit: float = CONDITION_LIMIT,
) -> ComplexArray:
    """Frequency response matrix from at least as many experiments as inputs.

    Solves ``H(k) U(k) = Y(k)`` at each line k in the least-squares sense, ``H = Y U^H (U U^H)^-1`` (thesis
    eq. 3.6, 3.7; with all blocks side by side, 3.10).

    Parameters
    ----------
    u
        Input spectra in N m, shape (..., n_freq, n_in, n_exp), n_exp >= n_in.
    y
        Output spectra in rad/s^2, shape (..., n_freq, n_out, n_exp).
    frequency_hz
        The lines, shape (n_freq,), for the message.
    condition_limit
        Largest condition number of U, its rows scaled as in `factor_inputs`.

    Returns
    -------
    H in (rad/s^2)/(N m), shape (..., n_freq, n_out, n_in); ``h[..., k, i, j]`` is output i over input j.

    Raises
    ------
    PoorExcitation
        If cond(U) exceeds the limit at some line; the message gives the line in Hz and its condition number.
    """
    _refuse_nan("output", y)
    factors = factor_inputs(u, condition_limit)
    poor = np.argwhere(~(factors.condition <= condition_limit))
    if len(poor):
        line = int(poor[0, -1])
        where = f"line {line}" if frequency_hz is None else f"{frequency_hz[line]:.4g} Hz"
        raise PoorExcitation(
            f"the input matrix at {where} has condition number {factors.condition[tuple(poor[0])]:.3g}, "
            f"above {condition_limit:.3g}; {len(poor)} such lines: excite every axis there, or leave them out"
        )
    return y @ factors.inverse


def refuse_masked(valid: BoolArray, frequency_hz: FloatArray, share: float = 0.1) -> None:
    """Raise PoorExcitation where more than `share` of a configuration's lines is masked, and say which lines.

    `valid` has shape (n_config, n_freq).
    """
    for configuration, lines in enumerate(valid):
        masked = frequency_hz[~lines]
        if len(masked) > share * len(lines):
            raise PoorExcitation(
                f"configuration {configuration}: {len(masked)} of {len(lines)} lines are masked, from "
                f"{masked.min():.4g} to {masked.max():.4g} Hz: the inputs do not span all axes; excite every "
                "axis at these lines, or look for an axis that did not move"
            )


def _refuse_nan(name: str, spectra: ComplexArray) -> None:
    if not np.isfinite(spectra).all():
        line, axis, experiment = (int(i) for i in np.argwhere(~np.isfinite(spectra))[0][-3:])
        raise DataRejected(
            f"the {name} spectrum is NaN or infinite, first at line {line}, axis {axis}, experiment "
            f"{experiment}; look for missing samples in the recording"
        )


def side_by_side(spectra: ComplexArray) -> ComplexArray:
    """Experiments of all blocks in one matrix per line (3.9).

    From (..., n_block, n_freq, n, n_exp) to (..., n_freq, n, n_block * n_exp).
    """
    moved = np.moveaxis(spectra, -4, -2)
    return moved.reshape(*moved.shape[:-2], -1)


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
    rotation = _rotation(matrices[0])
    logarithm = _matrix_function(rotation @ matrices, np.log).mean(axis=0)
    result[usable] = np.linalg.solve(rotation, _matrix_function(logarithm, np.exp))
    return result


def _rotation(matrices: ComplexArray) -> ComplexArray:
    """P of (3.13); any P will do that is invertible, so a matrix without eigenvectors gets a scalar one."""
    value, vector = np.linalg.eig(matrices)
    dependent = ~(np.linalg.cond(vector) < 1e8)
    vector[dependent] = np.eye(matrices.shape[-1])
    value[dependent] = value[dependent].sum(axis=-1, keepdims=True)
    turn = np.exp(-1j * np.angle(value))
    result: ComplexArray = (vector * turn[..., None, :]) @ np.linalg.inv(vector)
    return result


def _matrix_function(matrices: ComplexArray, function: np.ufunc) -> ComplexArray:
    """Primary function (log or exp) of matrices by eigenvectors, or by SciPy where these are dependent."""
    value, vector = np.linalg.eig(matrices)
    # Eigenvectors of condition kappa cost log10(kappa) digits; measured responses rarely come near this.
    dependent = ~(np.linalg.cond(vector) < 1e5)
    vector[dependent] = np.eye(matrices.shape[-1])
    with np.errstate(divide="ignore", invalid="ignore"):  # log 0 of a singular response: NaN comes out
        result: ComplexArray = (vector * function(value)[..., None, :]) @ np.linalg.inv(vector)
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
