"""Whether a machine had settled before the periods that were recorded.

What has not rung out differs from period to period near their beginning and fades from there: its spectra at
neighbouring bins are nearly alike. Those of noise are independent, and what happens at any time within a period turns
their ratio by any angle. So the mean product of neighbours over the mean of their sizes tells one from the other. It is
asked of the angles, which approach a pose under speed control for seconds after torques have settled.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from robid_core import FloatArray
from robid_core.estimation.torque.periodic import NOISY, PeriodicMotion
from robid_core.residual import PeriodicBlock, TorqueProblem

ALIKE = 0.5  # of neighbouring bins: noise has 0.05 at most (six drawn robots), what fades 0.8 to 1
SMALLEST = 1e-300


def unsettled_axes(problem: TorqueProblem) -> list[str]:
    """Axes that still settled while they were recorded, in records that repeat."""
    motions = [block.motion for block in problem.blocks if isinstance(block, PeriodicBlock)]
    if not motions:
        return []
    alike = likeness(motions)
    return [name for name, one in zip(problem.free.robot.axis_names, alike, strict=True) if one > ALIKE]


def likeness(motions: Sequence[PeriodicMotion]) -> FloatArray:
    """Mean product of what angles of periods differ by at neighbouring bins, over that of their sizes, (n_axis,)."""
    n_axis = motions[0].angle.shape[-1]
    products, sizes = np.zeros(n_axis), np.full(n_axis, SMALLEST)
    for motion in motions:
        highest = int(NOISY * motion.n_sample)
        differ = scipy.fft.rfft(motion.angle_deviation, axis=3)[:, :, :, 1:highest].reshape(
            -1, highest - 1, n_axis
        )
        product = differ[:, 1:] * differ[:, :-1].conj()
        products += product.real.sum(axis=(0, 1))
        sizes += np.abs(product).sum(axis=(0, 1))
    alike: FloatArray = products / sizes
    return alike
