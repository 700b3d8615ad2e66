"""Order and window chosen by the data: the fit that best predicts each line from its neighbours alone.

A line that is left out of its own window is predicted by what remains, and for linear least squares that
prediction needs no second fit: its error is ``(I - H)^-1 (y - G u)`` with H the part of the hat matrix that
belongs to the line, ``u^T Cov(G) u*`` for errors of variance one, since at the line itself the denominator's
regressors are zero. Its square holds the variance of the prediction and the error of the local model alike;
what is compared is the mean of its logarithm over lines and outputs, so that each counts by the factor by
which it is better or worse. One choice serves all lines of a configuration: line by line the criterion has an
uncertainty of a factor, and a choice that jumps makes a response that does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.response.local.model import LocalModel

Choose = Literal["none", "window", "order", "both"]

ORDERS = (1, 2, 3, 4)
GROWTH = 1.35
"""Ratio of a window that is tried to the next: the variance changes as much, which is hardly seen in the result."""
PREDICTED = 1e-10
"""Share of an error that is not a line's own doing, below which its neighbours say nothing of it."""


@dataclass(frozen=True)
class Candidate:
    """A model and the lines of its windows."""

    model: LocalModel
    window_lines: int


def prediction_error(
    u: ComplexArray, y: ComplexArray, response: ComplexArray, own_gram: ComplexArray
) -> FloatArray:
    """Mean square over experiments of the error of each line's prediction from its neighbours, (n_freq, n_out).

    Parameters
    ----------
    u, y
        Spectra (n_freq, n_in, n_exp) and (n_freq, n_out, n_exp).
    response
        Fitted with the lines themselves, (n_freq, n_out, n_in).
    own_gram
        Variance of each row of the response for errors of variance one, (n_freq, n_out, n_in, n_in) or one for all
        outputs, (n_freq, 1, n_in, n_in), such that
        ``U^H gram U`` is the conjugate of H.
    """
    error = y - response @ u
    basis, r = np.linalg.qr(u.swapaxes(-1, -2))  # the hat matrix lives on what the inputs span
    hat = r[:, None] @ own_gram.conj() @ r[:, None].conj().swapaxes(-1, -2)
    share, vector = np.linalg.eigh(hat)
    vector = basis[:, None] @ vector
    left = 1.0 - share
    predicted = left > PREDICTED
    growth = np.where(predicted, 1.0 / np.where(predicted, left, 1.0), 0.0) - 1.0
    inside = (vector.conj().swapaxes(-1, -2) @ error[..., None])[..., 0]
    error = error + (vector @ (growth * inside)[..., None])[..., 0]
    result: FloatArray = np.mean(np.abs(error) ** 2, axis=2)
    return result


def score(error: FloatArray) -> float:
    """Mean logarithm of prediction errors (n_freq, n_out); infinite where a line has none."""
    if not np.isfinite(error).all():
        return np.inf
    return float(np.mean(np.log(np.maximum(error, np.finfo(np.float64).tiny))))


def candidates(
    model: LocalModel,
    choose: Choose,
    n_freq: int,
    n_in: int,
    n_out: int,
    n_exp: int,
    n_stated: int,
    window_lines: int | None,
) -> list[Candidate]:
    """What is tried: windows from the smallest with a line to spare, orders equal above and below.

    Polynomials (denominators of order zero) are tried from order zero. A window that is given, or else the
    default one of each order, is kept when only the order is chosen.
    """
    models = [model]
    if choose in ("order", "both"):
        rational = model.denominator_order > 0
        models = [
            replace(model, numerator_order=order, denominator_order=order if rational else 0)
            for order in (ORDERS if rational else (0, *ORDERS))
        ]
    result: list[Candidate] = []
    for one in models:
        smallest = one.smallest_window(n_in, n_out, n_exp, 0, n_stated) + 1
        sizes: list[int] = [window_lines or one.comfortable_window(n_in, n_out, n_exp, n_stated)]
        if choose in ("window", "both"):
            sizes, size = [], float(smallest)
            while size <= n_freq:
                sizes.append(min(n_freq, int(size) // 2 * 2 + 1))
                size = max(size + 2, size * GROWTH)
        result.extend(Candidate(one, size) for size in dict.fromkeys(sizes) if smallest <= size <= n_freq)
    return result


def best_candidate(tried: list[Candidate], judge: Callable[[Candidate], float]) -> Candidate:
    """Candidate with the smallest score; of equal ones that with fewest unknowns and lines, which comes first."""
    scores = [judge(one) for one in tried]
    return tried[int(np.argmin(scores))]
