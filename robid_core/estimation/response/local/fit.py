"""Local rational fits of all lines of a configuration, direct or joint input-output: spectra in, `LocalFit` out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.response.local.choice import (
    Candidate,
    Choose,
    best_candidate,
    candidates,
    prediction_error,
    score,
)
from robid_core.estimation.response.local.compiled import CompiledFit, can_be_compiled, compiled_fit
from robid_core.estimation.response.local.iteration import Iteration
from robid_core.estimation.response.local.joint import condition_of, ratio
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.plain import PlainFit, plain_fit
from robid_core.estimation.response.local.prior import denominators
from robid_core.estimation.response.local.result import LocalFit
from robid_core.estimation.response.local.window import choose_windows

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

CONDITION_LIMIT = 1e6


def local_rational(
    u: ComplexArray,
    y: ComplexArray,
    frequency_hz: FloatArray,
    model: LocalModel,
    *,
    reference: ComplexArray | None = None,
    window_lines: int | None = None,
    window_hz: float | None = None,
    iterations: int = 0,
    iteration: Iteration = "instruments",
    poles_hz: ComplexArray | None = None,
    choose: Choose = "none",
    condition_limit: float = CONDITION_LIMIT,
    compiled: bool = True,
) -> LocalFit:
    """Response matrix at each line from a rational function fitted to the lines around it.

    Parameters
    ----------
    u, y
        Input spectra (n_freq, n_in, n_exp) and output spectra (n_freq, n_out, n_exp); one experiment is enough.
    frequency_hz
        Lines, increasing, shape (n_freq,); they may be irregular.
    model
        Orders and parametrisation.
    reference
        Spectra (n_freq, n_in, n_exp). With it, outputs and inputs together are fitted over the reference and G is
        their ratio (joint input-output approach), without bias from feedback; without it, y over u (direct).
    window_lines, window_hz
        Size of the windows; see `window.choose_windows`.
    iterations, iteration
        Passes against the bias of the linearised equations; see `iteration`.
    poles_hz
        Complex frequencies of a nominal model's poles (`prior.pole_frequencies`); denominators are then made
        of them, and the numerator alone is fitted. Direct approach only: the poles of the loop are others.
    choose
        What the data shall choose for all lines: window, order, both; see `choice`. Given sizes then count for
        nothing.
    condition_limit
        Lines where the numerator's regressors (columns scaled), or G_ru, have a larger condition number are
        not valid.
    compiled
        Use the kernel where it can; False for the plain form throughout.

    Raises
    ------
    DataRejected
        If a spectrum holds NaN, the reference lacks inputs, or the band has fewer lines than unknowns.
    ConfigurationError
        If a window has fewer lines than unknowns, or poles are given with a reference.
    """
    n_out, n_in, n_exp = y.shape[1], u.shape[1], u.shape[2]
    _refuse_unusable(u, y, reference, frequency_hz)
    if poles_hz is not None:
        if reference is not None:
            raise ConfigurationError(
                "prior poles are those of the robot, and the joint approach sees those of the loop; take the direct "
                "approach, or leave the poles to the data"
            )
        model = LocalModel("scalar", model.numerator_order, 0, model.transient_order)
    z = y if reference is None else np.concatenate((y, u), axis=1)
    r = u if reference is None else reference
    n_fitted = z.shape[1]
    in_loop = reference is not None and model.parametrization == "mimo" and model.denominator_order > 0

    def fit_with(
        model: LocalModel,
        lines: int | None,
        hertz: float | None,
        passes: int,
        plainly: bool,
        judged: bool = False,
    ) -> tuple[PlainFit | CompiledFit, FloatArray]:
        windows = choose_windows(
            frequency_hz, model, n_in, n_fitted, n_exp, window_lines=lines, window_hz=hertz, n_stated=n_out
        )
        freedom = np.array([model.freedom(int(size), n_in, n_fitted, n_exp) for size in windows.size])
        if not plainly and passes == 0 and poles_hz is None and can_be_compiled(model, n_fitted):
            return compiled_fit(r, z, windows, model, with_covariance=not judged), freedom
        known = None if poles_hz is None else denominators(poles_hz, windows, model.numerator_order)
        plain = plain_fit(
            r,
            z,
            windows,
            model,
            iterations=passes,
            how=iteration,
            denominators=known,
            loop_freedom=freedom if in_loop else None,
        )
        return plain, freedom

    def judge(candidate: Candidate) -> float:
        fit, _ = fit_with(candidate.model, candidate.window_lines, None, 0, not compiled, judged=True)
        return score(prediction_error(r, z, fit.numerator[:, 0], fit.own_gram()))

    words: tuple[str, ...] = ()
    if choose != "none":
        tried = candidates(model, choose, len(frequency_hz), n_in, n_fitted, n_exp, n_out, window_lines)
        if tried:
            best = best_candidate(tried, judge)
            model, window_lines, window_hz = best.model, best.window_lines, None
            words = (
                f"of {len(tried)} windows and orders {window_lines} lines and orders "
                f"{model.numerator_order}/{model.denominator_order} predict lines from their neighbours best",
            )
    fit, freedom = fit_with(model, window_lines, window_hz, iterations, in_loop or not compiled)
    windows = fit.windows
    valid = fit.condition <= condition_limit
    response, left, right = fit.numerator[:, 0].copy(), None, None
    if reference is not None:
        valid &= condition_of(response[:, n_out:]) <= condition_limit
        response[~valid] = np.eye(n_fitted, n_in) + np.eye(n_fitted, n_in, k=-n_out)
        response, left, right = ratio(response, n_out)
    stated = bool(freedom.min() >= n_out and valid.any())
    gram, covariance = np.full((len(valid), n_in, n_in), np.nan + 0j), None
    if stated:
        gram, covariance = fit.factors(freedom, valid, left, right)
        covariance[~valid] = np.nan
    numerator, denominator = fit.numerator.copy(), fit.denominator.copy()
    for array in (response, gram, numerator, denominator):
        array[~valid] = np.nan
    return LocalFit(
        windows=windows,
        response=response,
        gram_inverse=gram,
        output_covariance=covariance,
        degrees_of_freedom=np.where(valid, freedom, 0.0) if stated else np.zeros(len(valid)),
        valid=valid,
        numerator=numerator,
        denominator=denominator,
        passes=fit.passes,
        words=words,
    )


def _refuse_unusable(
    u: ComplexArray, y: ComplexArray, reference: ComplexArray | None, frequency_hz: FloatArray
) -> None:
    for name, spectra in (("input", u), ("output", y), ("reference", reference)):
        if spectra is not None and not np.isfinite(spectra).all():
            line, axis, experiment = (int(i) for i in np.argwhere(~np.isfinite(spectra))[0])
            raise DataRejected(
                f"the {name} spectrum is NaN or infinite, first at {frequency_hz[line]:.4g} Hz, axis {axis}, "
                f"experiment {experiment}; look for missing samples in the recording"
            )
    if reference is not None and reference.shape[1] != u.shape[1]:
        raise DataRejected(
            f"the reference has {reference.shape[1]} axes and the input {u.shape[1]}: G_ru cannot be inverted; joint "
            "methods need a reference for every input"
        )
