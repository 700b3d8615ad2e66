"""Covariance of least-squares estimates whose residuals are correlated in time (heteroskedasticity and
autocorrelation consistent, HAC).

With scores ``g_t = J_t^T r_t`` the estimate's covariance is ``H^-1 Omega H^-1``, H the Gauss-Newton matrix and Omega
the long-run covariance of the scores (W. K. Newey, K. D. West, Econometrica 55, 1987). It is taken from the scores'
lowest cosine transforms, each of which has it as its variance: ``Omega = n / B sum_j c_j c_j^T`` with ``c_j = sqrt(2 /
n) sum_t g_t cos(pi j (t - 1/2) / n) / sqrt(n)``, j from 1 to ``B = 0.41 n^(2/3)`` (E. Lazarus, D. J. Lewis, J. H.
Stock, M. W. Watson, HAR inference: recommendations for practice, Journal of Business and Economic Statistics 36,
2018). Weighted sums of autocovariances were tried: Bartlett's weights leak. Where noise of an encoder goes through a
speed loop, residuals are differences of white noise and their spectrum is next to nothing where the motion is; errors
were then told six times too large.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from robid_core.arrays import FloatArray


def n_cosine(n_sample: int) -> int:
    """Cosine transforms that count of a sequence, B: degrees of freedom of a variance."""
    return max(int(0.41 * n_sample ** (2 / 3)), 1)


def long_run_matrix(scores: Sequence[FloatArray]) -> FloatArray:
    """Covariance of the sum of scores that are correlated in time within lanes, and not between them.

    Parameters
    ----------
    scores
        Sequences in time, (n_lane, n_sample, n) each; means do not count.

    Returns
    -------
    Omega, shape (n, n), of the sum over all samples and lanes.
    """
    total = np.zeros((scores[0].shape[2],) * 2)
    for one in scores:
        n_sample = one.shape[1]
        transforms = scipy.fft.dct(one, axis=1, norm="ortho")[:, 1 : n_cosine(n_sample) + 1]
        flat = transforms.reshape(-1, one.shape[2])
        total += n_sample / transforms.shape[1] * flat.T @ flat
    return total


def sandwich_covariance(information: FloatArray, long_run: FloatArray) -> FloatArray:
    """H^-1 Omega H^-1, symmetric, shape (n, n); H is scaled to a unit diagonal before it is inverted."""
    scale = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    covariance: FloatArray = inverse @ long_run @ inverse
    return (covariance + covariance.T) / 2
