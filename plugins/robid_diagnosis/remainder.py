"""Whether more than noise is left where a cause acts.

A law that is near to the true one leaves little, and that little lies in the frequencies in which the law acts. A
misfit of all data dilutes it. Here what is left counts by how much the causes have changed there. The mean of squares
of noise in such weights is nearly chi-square distributed, with as many degrees of freedom as its variance says
(Satterthwaite 1946, Biometrics Bulletin 2).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from robid_core import FloatArray
from robid_core.residual import TorqueBlock
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.trials import SAME, WRONG

FAINT = 0.01  # share of the data of a bin: of what counts less nothing is asked
REMAINS = 1e-4  # probability that noise leaves so much where a cause acts: less is no chance


def chance_of_remainders(base: Fitted, final: Fitted, places: list[str | None]) -> list[float]:
    """Probability that noise alone leaves so much where each cause acts; one where noise is not what is left.

    Parameters
    ----------
    base, final
        Fits without causes and with all of them.
    places
        Axis of each cause; what acts at no axis changes the robot itself, and is asked at all axes.
    """
    if final.misfit > WRONG:
        return [1.0] * len(places)
    weights, names = final.about.weights, final.problem.free.robot.axis_names
    left, before = (
        np.concatenate([_by_channel(rows, fit) for rows in fit.problem.weighted(fit.point, weights)])
        for fit in (final, base)
    )
    share = np.concatenate([_share_by_channel(block) for block in final.problem.blocks])
    channels = [[names.index(on)] if on in names else range(left.shape[1]) for on in places]
    return [
        chance_of_remainder(left[:, own].ravel(), (before - left)[:, own].ravel(), share[:, own].ravel())
        for own in channels
    ]


def chance_of_remainder(left: FloatArray, changed: FloatArray, share: FloatArray) -> float:
    """Probability that noise leaves so much where something was changed.

    No law is its machine's to the last: an error of it that is as small as that of laws which are one class is no
    remainder.

    Parameters
    ----------
    left
        What a fit leaves, in standard deviations of noise or in proportion to them; zero where nothing was measured.
    changed
        By how much its causes have changed that, of the same shape.
    share
        Of the data that count, likewise: noise leaves so much of its power. Bins of a motion of which a share counts
        are that much less independent.
    """
    counts = (left != 0) & (share > FAINT)
    weight, share = np.abs(changed[counts]), share[counts]
    if not weight.any():
        return 1.0
    weight /= weight.sum()
    freedom = float(weight @ share) / float((weight**2).sum())
    square, same = left[counts] ** 2, SAME * changed[counts] ** 2
    remainder = float(weight @ ((square - same) / share)) * float(share.sum() / square.sum())
    return float(scipy.stats.chi2.sf(freedom * remainder, freedom))


def _by_channel(rows: FloatArray, fit: Fitted) -> FloatArray:
    """Weighted residuals of a block, (n_config, n_exp, n_row), as (n_row of all, n_channel)."""
    return rows.reshape(-1, fit.problem.blocks[0].measured.shape[-1])


def _share_by_channel(block: TorqueBlock[Any]) -> FloatArray:
    """Share of a block's data that count, likewise: of real and of imaginary parts."""
    share = block.share[:, :, None].repeat(2, axis=2)
    return share.reshape(-1, share.shape[-1])
