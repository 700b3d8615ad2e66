"""Whether delays of torques are those of a controller that is some times faster than its recording.

Such a controller holds each torque for that part of a sample. What acts is the mean over the hold: late by half of it,
on all axes alike, and a little smaller at high frequencies (by one in a hundred at a thirteenth of the controller's
rate). A delay alone leaves that over, and a lag of the current loop would take it.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray

NEAR = 0.02  # samples by which a delay may miss that of a hold
SURE = 4.0  # standard errors of a delay
MOST = 5  # times as fast: less than a tenth of a sample says nothing


def times_faster(lag: FloatArray, error: FloatArray) -> int | None:
    """Return how often a controller acts in a sample by the delays of its torques; None where they say nothing of it.

    Parameters
    ----------
    lag
        By how much torques come later than angles in a record that states them as continuous, samples, (n_axis,): below
        zero, since a held torque acts later than its sample.
    error
        Their standard errors, (n_axis,).

    Examples
    --------
    >>> import numpy as np
    >>> times_faster(np.array([-0.249, -0.252]), np.array([0.001, 0.001]))  # half a sample: twice as fast
    2
    >>> times_faster(np.array([-0.249, -0.4]), np.array([0.001, 0.001]))
    """
    weight = 1 / np.maximum(error, 1e-9) ** 2
    mean = float(np.average(lag, weights=weight))
    if not (np.isfinite(mean) and mean < 0):
        return None
    times = max(round(-0.5 / mean), 1)
    apart = np.abs(lag + 0.5 / times)
    if times > MOST or (apart > np.maximum(NEAR, SURE * error)).any():
        return None
    return times
