"""Local rational fits of all lines of a configuration, direct or joint input-output: spectra in, `LocalFit` out."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.response.local.between_blocks import jackknife_variance, widening
from robid_core.estimation.response.local.choice import (
    Candidate,
    Choose,
    best_candidate,
    candidates,
    prediction_error,
    score,
)
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.result import LocalFit
from robid_core.estimation.response.local.task import Task

CONDITION_LIMIT = 1e6
FEW = 1000
"""Lines times experiments below which the plain form is used: compiling the kernel takes ten seconds, once, and saves a
tenth of a second there (1, 2 and 6 axes, 30 lines: 0.01 and 0.02 s by either way, 0.04 s plain on six; by hand)."""


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
    poles_hz: ComplexArray | None = None,
    choose: Choose = "none",
    condition_limit: float = CONDITION_LIMIT,
    n_block: int = 1,
    compiled: bool | None = None,
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
    iterations
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
    n_block
        Blocks of the measurement, equally many experiments of each, side by side; with several the covariance is
        scaled to how much they differ (`between_blocks`).
    compiled
        Use the kernel where it can; False for the plain form throughout; None: the kernel from `FEW` on.

    Raises
    ------
    DataRejected
        If a spectrum holds NaN, the reference lacks inputs, or the band has fewer lines than unknowns.
    ConfigurationError
        If a window has fewer lines than unknowns, or poles are given with a reference.
    """
    _refuse_unusable(u, y, reference, frequency_hz)
    if poles_hz is not None:
        if reference is not None:
            raise ConfigurationError(
                "prior poles are those of the robot, and the joint approach sees those of the loop; take the direct "
                "approach, or leave the poles to the data"
            )
        model = LocalModel("scalar", model.numerator_order, 0, model.transient_order)
    task = Task(
        r=u if reference is None else reference,
        z=y if reference is None else np.concatenate((y, u), axis=1),
        frequency_hz=frequency_hz,
        n_out=y.shape[1],
        joint=reference is not None,
        poles_hz=poles_hz,
        compiled=len(frequency_hz) * u.shape[2] >= FEW if compiled is None else compiled,
    )
    words: tuple[str, ...] = ()
    if choose != "none":
        model, chosen, words = _chosen(task, model, choose, window_lines)
        if chosen is not None:
            window_lines, window_hz = chosen, None
    windows = task.windows(model, window_lines, window_hz)
    freedom = task.freedom(model, windows)
    fit = task.fit(model, windows, iterations)
    found = task.ratio(fit, condition_limit)
    valid, response = found.valid, found.response
    n_out, n_in = response.shape[1:]
    gram, covariance = np.full((len(valid), n_in, n_in), np.nan + 0j), None
    if freedom.min() >= n_out and valid.any():
        gram, covariance = fit.factors(freedom, valid, found.left, found.right)
        scatter = jackknife_variance(task, model, windows, iterations, n_block, condition_limit)
        if scatter is None:
            words = (*words, "the variation from block to block is not in the total uncertainty")
        else:
            stated = (
                np.einsum("fii->fi", covariance).real[..., None] * np.einsum("fjj->fj", gram).real[:, None]
            )
            factor, behind = widening(scatter, stated, valid, n_block)
            covariance = covariance * factor[:, None, None]
            freedom = 1.0 / (1.0 / freedom + 1.0 / behind)
            words = (
                *words,
                f"times {np.median(factor[valid]):.2g}, as the {n_block} blocks differ from one another",
            )
        covariance[~valid] = np.nan
    numerator, denominator = fit.numerator.copy(), fit.denominator.copy()
    for array in (response, gram, numerator, denominator):
        array[~valid] = np.nan
    return LocalFit(
        windows=windows,
        response=response,
        gram_inverse=gram,
        output_covariance=covariance,
        degrees_of_freedom=np.where(valid, freedom, 0.0) if covariance is not None else np.zeros(len(valid)),
        valid=valid,
        numerator=numerator,
        denominator=denominator,
        passes=fit.passes,
        words=words,
    )


def _chosen(
    task: Task, model: LocalModel, choose: Choose, window_lines: int | None
) -> tuple[LocalModel, int | None, tuple[str, ...]]:
    """Model and lines of a window that predict lines best; as given where nothing can be tried."""
    n_freq, n_in, n_exp = task.r.shape
    tried = candidates(model, choose, n_freq, n_in, task.z.shape[1], n_exp, task.n_out, window_lines)
    if not tried:
        return model, None, ()

    def judge(candidate: Candidate) -> float:
        windows = task.windows(candidate.model, candidate.window_lines, None)
        fit = task.fit(candidate.model, windows, judged=True)
        return score(prediction_error(task.r, task.z, fit.numerator[:, 0], fit.own_gram()))

    best = best_candidate(tried, judge)
    model = best.model
    words = (
        f"of {len(tried)} windows and orders {best.window_lines} lines and orders "
        f"{model.numerator_order}/{model.denominator_order} predict lines from their neighbours best"
    )
    return model, best.window_lines, (words,)


def _refuse_unusable(
    u: ComplexArray, y: ComplexArray, reference: ComplexArray | None, frequency_hz: FloatArray
) -> None:
    for name, spectra in (("input", u), ("output", y), ("reference", reference)):
        if spectra is not None and not np.isfinite(spectra).all():
            line, axis, experiment = (int(i) for i in np.argwhere(~np.isfinite(spectra))[0])
            raise DataRejected(
                f"the {name} spectrum is NaN or infinite, first at {frequency_hz[line]:.4g} Hz, axis {axis + 1}, "
                f"experiment {experiment + 1}; look for missing samples in the recording"
            )
    if reference is not None and reference.shape[1] != u.shape[1]:
        raise DataRejected(
            f"the reference has {reference.shape[1]} axes and the input {u.shape[1]}: G_ru cannot be inverted; joint "
            "methods need a reference for every input"
        )
