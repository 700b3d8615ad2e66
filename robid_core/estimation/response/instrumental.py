"""Response matrix by instrumental variables, with the scatter of its residuals: one formula for every approach.

Columns of U, Y and Z are samples of the spectra at a line: experiments, periods, segments or bins of a band. With
``U^ = U P_Z``, the inputs as far as the instruments explain them, ``G = Y U^+^H (U^ U^^H)^-1``. Instruments Z = U
give the direct approach ``S_yu S_uu^-1``, Z = R the joint input-output approach ``S_yr S_ur^-1`` (thesis 3.2.2
and eq. 3.14); more instruments than inputs give two-stage least squares (Ljung 1999, section 7.6; Soderstrom and
Stoica 1983), which does not depend on the instruments' units as ``S_yz S_uz^H (S_uz S_uz^H)^-1`` would.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import PoorExcitation
from robid_core.estimation.response.covariance import period_products
from robid_core.estimation.response.spectra import CONDITION_LIMIT, factor_inputs

Correlate = Callable[[ComplexArray], ComplexArray]


@dataclass(frozen=True)
class InstrumentalResponse:
    """G (..., n_out, n_in), NaN where the instruments do not span the inputs, and what belongs to it.

    `projected` is ``U^`` (..., n_in, n_column), `inverse` its pseudo-inverse (..., n_column, n_in), so that
    ``G = Y inverse``; `residual` is ``V = Y - G U`` (..., n_out, n_column).
    """

    response: ComplexArray
    projected: ComplexArray
    inverse: ComplexArray
    residual: ComplexArray


def project(u: ComplexArray, z: ComplexArray, condition_limit: float = CONDITION_LIMIT) -> ComplexArray:
    """``U Z^+ Z``: the part of the inputs that the instruments explain, shape of `u`.

    Instruments that say the same twice (a reference, and inputs that follow it without noise) count once: directions
    of Z below its largest over `condition_limit`, rows scaled to equal size, are not used. Takes u and z of shapes
    (..., n_line, n_in, n_column) and (..., n_line, n_instrument, n_column).
    """
    size = np.sqrt(np.mean(np.abs(z) ** 2, axis=(-3, -1), keepdims=True))
    _, singular, right = np.linalg.svd(z / np.where(size > 0, size, 1.0), full_matrices=False)
    used = singular > np.maximum(singular[..., :1] / condition_limit, np.finfo(np.float64).tiny)
    result: ComplexArray = ((u @ right.conj().swapaxes(-1, -2)) * used[..., None, :]) @ right
    return result


def instrumental_response(
    u: ComplexArray, y: ComplexArray, z: ComplexArray | None, condition_limit: float = CONDITION_LIMIT
) -> InstrumentalResponse:
    """Response of all lines from inputs, outputs and instruments (None: the inputs themselves).

    Consistent where the instruments are independent of the disturbance ``V = Y - G U`` and correlated with the
    inputs. In feedback ``u = r - F y`` the inputs are not: for one axis the direct approach tends to
    ``(G S_rr - F* S_vv) / (S_rr + |F|^2 S_vv)`` (Wellstead 1981), the reference as instrument to G.

    Parameters
    ----------
    u, y, z
        Shapes (..., n_line, n_in, n_column), (..., n_line, n_out, n_column) and (..., n_line, n_instrument,
        n_column), n_instrument >= n_in.
    condition_limit
        Lines whose projected inputs have a larger condition number (see `factor_inputs`) become NaN.

    Raises
    ------
    PoorExcitation
        With fewer columns than inputs, or fewer instruments.
    """
    n_in = u.shape[-2]
    if z is not None and z.shape[-2] < n_in:
        raise PoorExcitation(f"{z.shape[-2]} instruments cannot stand for {n_in} inputs; add channels")
    projected = u if z is None else project(u, z, condition_limit)
    inverse = _inverse(projected, condition_limit)
    response: ComplexArray = y @ inverse
    return InstrumentalResponse(response, projected, inverse, y - response @ u)


def _inverse(projected: ComplexArray, condition_limit: float) -> ComplexArray:
    """Pseudo-inverse of the projected inputs, NaN on lines where these are NaN."""
    usable = np.all(np.isfinite(projected), axis=(-2, -1), keepdims=True)
    known = np.where(usable, projected, 0)
    # Lines without use get any full rank, of the axes' own sizes: the scaling of the others must not feel them.
    size = np.sqrt(np.mean(np.abs(known) ** 2, axis=(-3, -1), keepdims=True))
    filler = np.where(size > 0, size, 1.0) * np.eye(*projected.shape[-2:])
    inverse = factor_inputs(np.where(usable, projected, filler), condition_limit).inverse
    return np.where(usable, inverse, np.nan)


@dataclass(frozen=True)
class Scatter:
    """Residual products of a response and their degrees of freedom; shapes per line.

    `products` is ``V V^H`` (..., n_out, n_out), of expectation `weight` (...,) times C_V, and has
    `degrees_of_freedom` (...,); `gram_inverse` (..., n_in, n_in) makes ``conj(gram_inverse) (x) C_V`` the
    covariance of vec(G).
    """

    products: ComplexArray
    weight: FloatArray
    degrees_of_freedom: FloatArray
    gram_inverse: ComplexArray


def scatter(
    estimate: InstrumentalResponse, correlate: Correlate, trace: float, trace_of_square: float
) -> Scatter:
    """Residual products and the factors of the covariance where columns are correlated.

    Let ``E[V_k V_l^H] = C_V gamma_kl`` (overlapping windows see the same samples twice). Then ``dG = V X`` with
    ``X = U^^H (U^ U^^H)^-1`` has the covariance ``conj(X^H conj(Gamma) X) (x) C_V``, without an approximation
    beyond "the inputs are given". With the projector ``Q = I - X U^`` and ``K = conj(Gamma)`` the products have
    the expectation ``tr(K Q) C_V`` and, by the first two moments (Satterthwaite 1946),
    ``tr(K Q)^2 / tr(K Q K Q)`` degrees of freedom. For Q = I that is the equivalent number of averages of Welch
    (1967), ``n / (1 + 2 sum_m (1 - m / n) |c_m|^2)``; for uncorrelated columns it is n_column - n_in.

    Parameters
    ----------
    estimate
        The response; instruments other than the inputs leave terms of second order out.
    correlate
        ``x -> x conj(Gamma)`` over columns.
    trace, trace_of_square
        tr Gamma and tr Gamma^2, the same for all lines.
    """
    x_h = np.where(np.isfinite(estimate.inverse), estimate.inverse, 0).conj().swapaxes(-1, -2)
    hat = np.where(np.isfinite(estimate.projected), estimate.projected, 0)
    hat_h = hat.conj().swapaxes(-1, -2)
    spread = correlate(x_h)
    gram_inverse = spread @ x_h.conj().swapaxes(-1, -2)
    mixed = spread @ hat_h
    weight = trace - _trace(mixed)
    squares = (
        trace_of_square
        - 2 * _trace(spread @ spread.conj().swapaxes(-1, -2) @ (hat @ hat_h))
        + _trace(mixed @ mixed)
    )
    # What rounding leaves where no column is to spare is not a degree of freedom.
    weight = np.where(weight > 1e-9 * trace, weight, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = np.where(weight > 0, weight**2 / squares, 0.0)
    products = estimate.residual @ estimate.residual.conj().swapaxes(-1, -2)
    return Scatter(products, weight, freedom, 0.5 * (gram_inverse + gram_inverse.conj().swapaxes(-1, -2)))


def _trace(matrices: ComplexArray) -> FloatArray:
    result: FloatArray = np.einsum("...ii->...", matrices).real
    return result


def multiple_coherence(u: ComplexArray, y: ComplexArray) -> FloatArray:
    """Share of each output's power that the inputs together explain, ``S_yu S_uu^-1 S_uy / S_yy``, (..., n_out).

    One without noise, leakage and nonlinearity; of n_column columns of pure noise it has the mean n_in / n_column
    (Bendat and Piersol 2010, section 7.3). With the reference in place of `u` and the inputs in place of `y` it
    tells how well a joint input-output method can work. NaN where the inputs are singular.

    Takes the shapes of `instrumental_response`.
    """
    estimate = instrumental_response(u, y, None)
    power = np.sum(np.abs(y) ** 2, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        result: FloatArray = 1.0 - np.sum(np.abs(estimate.residual) ** 2, axis=-1) / power
    return result


@dataclass(frozen=True)
class LineScatter:
    """A response with all that its uncertainty is made of; leading axes as the data's, then lines.

    `response` (..., n_out, n_in); `scatter` of the average over periods; `noise_products` (..., n_out, n_out) of
    the differences between periods, None with a single one; `power` (..., n_out) the mean of |Y|^2.
    """

    response: ComplexArray
    scatter: Scatter
    noise_products: ComplexArray | None
    power: FloatArray


def response_of_periods(
    u: ComplexArray,
    y: ComplexArray,
    z: ComplexArray | None,
    correlate: Correlate,
    trace: float,
    trace_of_square: float,
    condition_limit: float = CONDITION_LIMIT,
) -> LineScatter:
    """Response from the cross spectra of all columns and periods, scatter from the average over periods.

    The excitation, and with it the distortion of a nonlinear robot, is the same in every period: periods are
    samples for the cross spectra and for the noise, but an experiment counts once for the total scatter.

    Parameters
    ----------
    u, y, z
        Shapes (..., n_line, n, n_column, n_period); z None for the direct approach.
    correlate, trace, trace_of_square
        Correlation between columns, see `scatter`.
    condition_limit
        As in `instrumental_response`.
    """
    n_period = u.shape[-1]
    estimate = instrumental_response(_flat(u), _flat(y), None if z is None else _flat(z), condition_limit)
    hat = estimate.projected.reshape(u.shape).mean(axis=-1)
    averaged = InstrumentalResponse(
        estimate.response,
        hat,
        _inverse(hat, condition_limit),
        y.mean(axis=-1) - estimate.response @ u.mean(axis=-1),
    )
    noise = period_products(u, y, estimate.response) if n_period > 1 else None
    return LineScatter(
        estimate.response,
        scatter(averaged, correlate, trace, trace_of_square),
        noise,
        np.mean(np.abs(y) ** 2, axis=(-2, -1)),
    )


def _flat(spectra: ComplexArray) -> ComplexArray:
    return spectra.reshape(*spectra.shape[:-2], -1)
