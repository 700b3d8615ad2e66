"""How much more the blocks of a measurement differ than the residuals of its local fits say.

Residuals tell the scatter of a local fit if errors of neighbouring lines are independent. Some are not: a robot that
is carried to and fro has another mean inertia in each block, which moves whole resonances, and what least
squares does to second order is shared by a window too. Responses without one block after the other show both (the
delete-one jackknife, Efron and Stein 1981); their scatter has few degrees of freedom, so only one number a line is
taken from it, by how much the stated covariance is to be multiplied.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import BoolArray, FloatArray
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.task import Task
from robid_core.estimation.response.local.window import Windows

LEFT = 0.5
"""Share of the degrees of freedom that must be left without a block, or else its response is another estimator's."""
ENTRIES = 100
"""Differences between blocks that a number is taken from, at least: entries of as many lines as it takes."""


def jackknife_variance(
    task: Task, model: LocalModel, windows: Windows, iterations: int, n_block: int, condition_limit: float
) -> FloatArray | None:
    """Variance of each entry of the response from leaving out blocks, (n_freq, n_out, n_in).

    Experiments stand block after block, equally many of each. None where there is one block only, or too little
    is left without one.
    """
    if n_block < 2:
        return None
    n_exp = task.r.shape[2]
    block = np.arange(n_exp) // (n_exp // n_block)
    parts = [task.of_experiments(block != b) for b in range(n_block)]
    if (parts[0].freedom(model, windows) < LEFT * task.freedom(model, windows)).any():
        return None
    responses = np.stack(
        [part.ratio(part.fit(model, windows, iterations), condition_limit).response for part in parts]
    )
    square = np.sum(np.abs(responses - responses.mean(axis=0)) ** 2, axis=0)
    result: FloatArray = (n_block - 1) / n_block * square
    return result


def widening(
    variance: FloatArray, stated: FloatArray, valid: BoolArray, n_block: int
) -> tuple[FloatArray, float]:
    """Mean ratio of jackknife variances to stated ones, (n_freq,), with its degrees of freedom.

    Over the entries of a line and its neighbours; NaN counts nowhere. Entries and lines that share data go together:
    half of the degrees of freedom are counted.

    Parameters
    ----------
    variance, stated
        Shape (n_freq, n_out, n_in), positive.
    valid
        Lines that count, (n_freq,).
    """
    n_freq, n_out, n_in = variance.shape
    differences = (n_block - 1) * n_out * n_in
    half = min(max(1, int(np.ceil((ENTRIES / differences - 1) / 2))), n_freq)
    with np.errstate(divide="ignore", invalid="ignore"):
        line = np.where(valid, np.mean(variance / stated, axis=(1, 2)), np.nan)
    counts = np.isfinite(line)
    kernel = np.ones(2 * half + 1)
    total = np.convolve(np.where(counts, line, 0.0), kernel)[half : half + n_freq]
    number = np.convolve(counts.astype(np.float64), kernel)[half : half + n_freq]
    factor: FloatArray = np.where(number > 0, total / np.maximum(number, 1.0), 1.0)
    return factor, differences * (2 * half + 1) / 2
