"""How much wider tolerances would have to be for data to be most likely."""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray

WIDENED = 3.0  # times the tolerances that were stated: more is doubted


def tolerance_factor(
    deviation: FloatArray, error: FloatArray, prior: FloatArray, least_seen: float = 1e-9
) -> float:
    """Return the factor by empirical Bayes (MacKay, Neural Computation 4, 1992).

    Squares of what was found over the freedom that data, not tolerances, have decided.

    Parameters
    ----------
    deviation, error, prior
        Of each number that has a tolerance: from what was told, as it is stated after the data, before them; (n,).
    least_seen
        Freedom that is assumed at least.
    """
    seen = float((1 - np.minimum((error / prior) ** 2, 1.0)).sum())
    return float(np.sqrt(((deviation / prior) ** 2).sum() / max(seen, least_seen)))
