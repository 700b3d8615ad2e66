"""From spectra to the response matrix, line by line: what the estimators of thesis section 3.2.3 share.

Least squares on the inputs (3.7), (3.10), and projection on the references (3.14), each as a right inverse of
the inputs; means of several responses are in `means`. A line is a frequency; column e of U and Y is experiment
e. Everything is batched: leading axes (configurations, blocks) are free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.errors import DataRejected, PluginError, PoorExcitation
from robid_core.estimation.response.division import Quotient, divide, divide_jointly

CONDITION_LIMIT = 1e6  # half of the digits of a double are gone; measured spectra have fewer
MOST_MASKED = 0.1  # of a configuration's lines, with which a response is still one


@dataclass(frozen=True)
class InputFactors:
    """What the input matrices of all lines yield once and for all.

    `condition` has shape (..., n_freq) (see `estimation.response.division.Quotient`) and is infinite where an
    input matrix has no full rank; where it exceeds the limit the other two are NaN. `inverse` is
    ``U^+ = U^H (U U^H)^-1``, shape (..., n_freq, n_exp, n_in); `gram_inverse` is ``(U U^H)^-1``, shape
    (..., n_freq, n_in, n_in).
    """

    condition: FloatArray
    inverse: ComplexArray
    gram_inverse: ComplexArray


def factor_inputs(u: ComplexArray, condition_limit: float = CONDITION_LIMIT) -> InputFactors:
    """Condition, pseudo-inverse and inverse Gram matrix of the inputs.

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
    quotient = divide_spectra(u, None, condition_limit)
    return InputFactors(quotient.condition, quotient.value, quotient.gram_inverse)


def divide_spectra(
    u: ComplexArray,
    y: ComplexArray | None,
    condition_limit: float = CONDITION_LIMIT,
    *,
    joined: bool = False,
) -> Quotient:
    """Response ``Y U^+`` of each line, or ``U^+`` where y is None, with ``(U U^H)^-1``.

    As ``y @ factor_inputs(u).inverse``, in one go. With `joined` the experiments of all blocks stand side by
    side (3.10): u and y have shape (..., n_block, n_freq, n, n_exp), the results (..., n_freq, n, n).
    """
    n_in, n_exp = u.shape[-2:]
    _refuse_few(n_exp * (u.shape[-4] if joined else 1), n_in)
    quotient = divide(u, y, condition_limit, parts=joined)
    _refuse_spread(quotient, input=u, output=y)
    return quotient


def divide_by_reference(
    u: ComplexArray, y: ComplexArray, r: ComplexArray, condition_limit: float = CONDITION_LIMIT
) -> Quotient:
    """Joint input-output response ``Y R^H (U R^H)^-1`` of the experiments of all blocks (3.14).

    It is ``Y A`` with the right inverse ``A = R^H (U R^H)^-1`` of U, orthogonal to all that the references do not
    cause: of a residual ``V = Y - G U`` it passes on ``V A``. Where V is independent of R, as noise in a feedback
    loop is, the mean of that is zero, however much V and U have in common; with independent experiments of
    covariance C_V its covariance is ``(A^H A)^T (x) C_V``.

    Parameters
    ----------
    u, y, r
        Spectra of inputs, outputs and references, shape (..., n_block, n_freq, n_axis, n_exp), n_block n_exp >= n_axis.
    condition_limit
        Largest condition number, of U with A as its inverse (`estimation.response.division.divide_jointly`).

    Returns
    -------
    `value` the response, `gram_inverse` ``A^H A``, shape (..., n_freq, n_axis, n_axis), NaN where a line is refused.
    """
    _refuse_few(r.shape[-1] * r.shape[-4], r.shape[-2])
    quotient = divide_jointly(u, y, r, condition_limit)
    _refuse_spread(quotient, input=u, output=y, reference=r)
    return quotient


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
    quotient = divide_spectra(u, y, condition_limit)
    poor = np.argwhere(~(quotient.condition <= condition_limit))
    if len(poor):
        line = int(poor[0, -1])
        where = f"line {line}" if frequency_hz is None else f"{frequency_hz[line]:.4g} Hz"
        raise PoorExcitation(
            f"the input matrix at {where} has condition number {quotient.condition[tuple(poor[0])]:.3g}, "
            f"above {condition_limit:.3g}; {len(poor)} such lines: excite every axis there, or leave them out"
        )
    return quotient.value


def refuse_without_numbers(
    valid: BoolArray, spanned: BoolArray, frequency_hz: FloatArray, estimator: str
) -> None:
    """Raise PluginError where an estimator has no numbers at lines that are well excited, more than `MOST_MASKED`.

    `valid`: where it has numbers, and `spanned`: where the inputs span all axes, are (n_config, n_freq) each.
    """
    for number, (lines, excited) in enumerate(zip(valid, spanned, strict=True), 1):
        empty = frequency_hz[excited & ~lines]
        if len(empty) > MOST_MASKED * len(lines):
            raise PluginError(
                f"{estimator}: configuration {number}: NaN or infinite at {len(empty)} of {len(lines)} lines, "
                f"from {empty.min():.4g} to {empty.max():.4g} Hz, where the inputs span all axes: a fault of the "
                "estimator, not of the record"
            )


def refuse_masked(valid: BoolArray, frequency_hz: FloatArray, share: float = MOST_MASKED) -> None:
    """Raise PoorExcitation where more than `share` of a configuration's lines is masked, and say which lines.

    `valid` has shape (n_config, n_freq).
    """
    for number, lines in enumerate(valid, 1):
        masked = frequency_hz[~lines]
        if len(masked) > share * len(lines):
            raise PoorExcitation(
                f"configuration {number}: {len(masked)} of {len(lines)} lines are masked, from "
                f"{masked.min():.4g} to {masked.max():.4g} Hz: the inputs do not span all axes; excite every "
                "axis at these lines, or look for an axis that did not move"
            )


def _refuse_spread(quotient: Quotient, **spectra: ComplexArray | None) -> None:
    """Look for what is not a number where there is one that no refused line explains."""
    if np.isfinite(quotient.value).all() and np.isfinite(quotient.condition).all():
        return
    for name, values in spectra.items():
        if values is not None:
            _refuse_nan(name, values)


def _refuse_few(n_exp: int, n_in: int) -> None:
    if n_exp < n_in:
        raise PoorExcitation(
            f"{n_exp} experiment{'' if n_exp == 1 else 's'} cannot separate {n_in} inputs at any line (condition "
            "number infinite); "
            f"measure at least {n_in} experiments a block"
        )


def _refuse_nan(name: str, spectra: ComplexArray) -> None:
    if not np.isfinite(spectra).all():
        line, axis, experiment = (int(i) for i in np.argwhere(~np.isfinite(spectra))[0][-3:])
        raise DataRejected(
            f"the {name} spectrum is NaN or infinite, first at line {line + 1}, axis {axis + 1}, experiment "
            f"{experiment + 1}; look for missing samples in the recording"
        )


def side_by_side(spectra: ComplexArray) -> ComplexArray:
    """Experiments of all blocks in one matrix per line (3.9).

    From (..., n_block, n_freq, n, n_exp) to (..., n_freq, n, n_block * n_exp).
    """
    moved = np.moveaxis(spectra, -4, -2)
    return moved.reshape(*moved.shape[:-2], -1)
