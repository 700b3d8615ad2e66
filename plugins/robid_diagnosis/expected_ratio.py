"""What a new experiment is expected to tell of two hypotheses that were fitted to the same data.

Once it was measured, both are fitted anew, to old and new data together. With the precision H that the old data and the
priors leave to the unknowns of a hypothesis, and derivatives J of what it predicts of the new data (weighted: noise of
one), a difference d that it has to explain costs it

    min over x of  1/2 |d - J x|^2 + 1/2 x^T H x  =  1/2 d^T (I + J H^-1 J^T)^-1 d ,

by Gauss and Newton. That is the logarithm of the likelihood ratio that it loses: what its unknowns can take up does not
count. (J H^-1 J^T is the covariance of its prediction; Box and Hill 1967, Technometrics 9, and Buzzi-Ferraris and
Forzatti 1983, Chemical Engineering Science 38, discriminate with the same sum.) What both refits take up of the new
noise, half a unit for each unknown that the new data tell, is no evidence and is left out.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray


def expected_ratio(difference: FloatArray, rows: FloatArray, precision: FloatArray) -> float:
    """Logarithm of the likelihood ratio that a hypothesis is expected to lose.

    Parameters
    ----------
    difference
        Of what two hypotheses predict, in standard deviations, (n_row,).
    rows
        Derivatives of what this one predicts, likewise, (n_row, n_unknown).
    precision
        Of its unknowns before the experiment, (n_unknown, n_unknown).
    """
    scale = 1 / np.sqrt(np.diag(precision))
    moved = rows * scale
    after = precision * np.outer(scale, scale) + moved.T @ moved
    slope = moved.T @ difference
    return 0.5 * max(float(difference @ difference - slope @ np.linalg.solve(after, slope)), 0.0)
