"""Do the stated regions hold what they say? Complex 95 % regions over seeds, of the estimator's own mean and of G_BLA.

On lines at least a window apart, so that no residual counts twice. Estimators converge to different limits: a region
that holds the estimator's own mean is honest about its scatter, one that holds G_BLA is honest about its bias too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.frf_methods.estimates import Estimated
from studies.frf_methods.scenes import Scene

from reference import metrics  # isort: skip
from robid_core import IntArray

WINDOW = 11  # lines: no method shares residuals further, with 24 experiments


def lines(n_freq: int) -> IntArray:
    """Lines that are looked at."""
    return metrics.lines_apart(n_freq, WINDOW)


def row(scene: Scene, title: str, runs: Sequence[Estimated], judged: int) -> dict[str, str | float]:
    """Coverage of one method: the mean over all runs, the regions of the first `judged`.

    `size` is the median radius of a region over the size of the entry, on entries that the judge sees; `bias` the
    distance of the mean from G_BLA over the standard deviation of one run, root mean square.
    """
    chosen = lines(len(scene.truth.frequency_hz))
    truth, seen = scene.truth.response[chosen], scene.truth.seen[chosen]
    response = np.stack([one.response for one in runs])
    mean, variance_of_mean = response.mean(axis=0), response.var(axis=0, ddof=1) / len(runs)
    few = runs[:judged]
    variance = np.stack([one.variance for one in few])
    freedom = np.stack([one.freedom for one in few])[:, :, None, None]
    own = metrics.share(
        metrics.covered(response[:judged], mean, variance, freedom, truth_variance=variance_of_mean)
    )
    error_of_truth = scene.truth.standard_error[chosen] ** 2
    true = metrics.share(
        metrics.covered(response[:judged], truth, variance, freedom, truth_variance=error_of_truth)
    )
    radius = np.sqrt(metrics.region_factor(freedom) * variance)
    scatter = response.var(axis=0, ddof=1)
    bias = np.maximum(np.abs(mean - truth) ** 2 - variance_of_mean - error_of_truth, 0.0)
    return {
        "method": title,
        "claims": runs[0].covers,
        "own_mean": own.value,
        "own_low": own.lower,
        "own_high": own.upper,
        "g_bla": true.value,
        "g_bla_low": true.lower,
        "g_bla_high": true.upper,
        "bias_over_deviation": float(np.sqrt(np.mean(bias / scatter))),
        "size": float(np.median((radius / np.abs(truth))[:, seen])),
        "runs": len(runs),
    }
