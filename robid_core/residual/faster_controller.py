"""Whether delays of torques are those of a controller that is some times faster than its recording.

Such a controller holds each torque for that part of a sample. What acts is the mean over the hold: late by half of it,
on all axes alike, and a little smaller at high frequencies (by one in a hundred at a thirteenth of the controller's
rate). A delay alone leaves that over, and a lag of the current loop would take it.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray

NEAR = 0.01  # samples by which a delay may miss that of a hold
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
    >>> times_faster(np.array([-0.249, -0.252]), np.array([0.05, 0.05]))  # it may be three times as fast
    """
    if not (np.isfinite(lag).all() and np.isfinite(error).all()):
        return None
    holds = 0.5 / np.arange(1, MOST + 2)  # of which the last is that of a controller too fast to be told
    nearest = int(np.argmin(np.abs(holds + np.average(lag, weights=1 / np.maximum(error, 1e-6) ** 2))))
    others = float(np.abs(np.delete(holds, nearest) - holds[nearest]).min())
    sure = (error < 0.5 * others / SURE) & (np.abs(lag + holds[nearest]) < np.maximum(NEAR, SURE * error))
    return nearest + 1 if nearest < MOST and sure.all() else None
