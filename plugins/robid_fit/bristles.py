"""Stiffness and damping of friction before it slides, from small slow motions of one motor.

In presliding the bristles are a spring with a damper (Hensen, van de Molengraft and Steinbuch 2002; Ruderman and
Bertram 2011): ``friction = sigma_0 (q - q_0) + (sigma_1 + sigma_2) v``. Both signals of the fit are low-passed alike.
Energy that goes per path, over the Coulomb level, says how far a motion slides: 0 of a spring, 1 of plain sliding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import FloatArray

MOST_BLOCKS = 24  # stretches of time of all experiments: independent of one another
FEWEST_BLOCKS = 6


@dataclass(frozen=True, eq=False)
class SmallMotion:
    """One motor in one experiment, each (n_sample,): angle about its mean, speed, torque beyond the rigid robot."""

    position: FloatArray
    speed: FloatArray
    torque: FloatArray


@dataclass(frozen=True, eq=False)
class Bristles:
    """Stiffness N m/rad, damping N m s/rad (all that is in proportion to the speed), and their errors."""

    stiffness: float
    damping: float
    covariance: FloatArray
    """Widened for few stretches: 1.96 standard errors hold 95 %."""


def slid_share(motions: list[SmallMotion], coulomb: float) -> float:
    """Energy lost per path over the Coulomb level: what part of a sliding motion's it is."""
    lost = sum(float(one.torque @ one.speed) for one in motions)
    path = sum(float(np.abs(one.speed).sum()) for one in motions)
    return lost / (coulomb * path) if path > 0 else 0.0


def bristles_of(motions: list[SmallMotion]) -> Bristles:
    """Least squares over all experiments, each with its own mean torque; errors from stretches of time.

    Gradients summed over stretches scatter as those of the whole do (cluster sums: Liang and Zeger 1986).
    """
    rows, blocks = [], []
    per_motion = max(FEWEST_BLOCKS, MOST_BLOCKS // len(motions))
    for one in motions:
        columns = np.column_stack([one.position, one.speed, one.torque])
        rows.append(columns - columns.mean(axis=0))
        edges = np.linspace(0, len(one.position), per_motion + 1).astype(np.int64)
        blocks.append(np.searchsorted(edges, np.arange(len(one.position)), side="right") - 1)
    whole = np.concatenate(rows)
    x, y = whole[:, :2], whole[:, 2]
    inverse = np.linalg.inv(x.T @ x)
    value = inverse @ (x.T @ y)
    left = y - x @ value
    sums, at = [], 0
    for own in blocks:
        gradient = x[at : at + len(own)] * left[at : at + len(own), None]
        sums += [gradient[own == number].sum(axis=0) for number in range(per_motion)]
        at += len(own)
    scatter = np.array(sums)
    n = len(scatter)
    widening = scipy.stats.t.ppf(0.975, n - 2) / scipy.stats.norm.ppf(0.975)
    covariance: FloatArray = widening**2 * n / (n - 2) * inverse @ (scatter.T @ scatter) @ inverse
    return Bristles(float(value[0]), float(value[1]), covariance)
