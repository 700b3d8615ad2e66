"""Friction as a robot file says it, nearest to what free functions of speed found, and how sure it is.

A robot file has ``coulomb tanh(v / speed) + viscous v + offset``, a torque fit a sum of functions of speed. All four
numbers are those nearest to that sum over the measured speeds, by least squares. The speed within which friction turns
round is one of them: held at a wrong value, it made levels wrong by 150 of their standard errors. Where data tell
nothing of it, a prior holds it near the robot file's. The covariance of the functions goes through the same map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.estimation.torque.speed_functions import SpeedFunctions

SPEEDS = 4000  # of those that were measured, spread evenly over their order: enough of each
WIDTH_DEVIATION = 1.0  # of the logarithm of `speed` about the robot file's: a prior
FARTHEST = 4.0  # of these deviations are searched
GRID = 17  # widths, among which the best is refined
EXACT = 1e-9  # of the friction: what is more certain than this is not


@dataclass(frozen=True, eq=False)
class NearestFriction:
    """Friction of one motor, in the numbers of a robot file."""

    width: float
    """`speed` of the robot file, rad/s."""
    names: tuple[str, ...]
    """Of what was estimated: coulomb, offset, and speed and viscous where they are not held."""
    value: FloatArray
    """Of each, N m, N m, rad/s, N m s/rad."""
    slope: FloatArray
    """Derivative of each by the sizes of the functions, the constant, and the viscous part, (n_name, n_size)."""
    beyond: FloatArray
    """Covariance beside that of the sizes, (n_name, n_name): of the prior, and of what these numbers do not reach."""
    size: float
    """rms of the torque of friction over the measured speeds, N m."""
    left: float
    """rms of what these numbers do not reach of it, N m."""
    uncertainty: float
    """rms of the standard error of that torque, N m."""

    def torque(self, speed: FloatArray) -> FloatArray:
        """Return what it brakes with at speeds, rad/s, N m."""
        of = dict(zip(self.names, self.value.tolist(), strict=True))
        turning = of["coulomb"] * np.tanh(speed / self.width)
        torque: FloatArray = turning + of["offset"] + of.get("viscous", 0.0) * speed
        return torque


def nearest_friction(
    laws: SpeedFunctions,
    size: FloatArray,
    covariance: FloatArray,
    speed: FloatArray,
    told_width: float,
    *,
    held: bool = False,
) -> NearestFriction:
    """Return the nearest friction of one motor.

    Parameters
    ----------
    laws
        Its functions of speed.
    size
        Of the functions and a constant, N m, and of viscous friction, N m s/rad, where that is free: (n_law + 1,) or
        (n_law + 2,).
    covariance
        Of these sizes.
    speed
        As it was measured, rad/s, (n_sample,).
    told_width
        `speed` of the robot file, rad/s.
    held
        Whether it stays.
    """
    speed = _spread(speed)
    linear = [np.ones_like(speed), *([speed] if len(size) > len(laws.names) else [])]
    shapes = np.stack([*(law[:, 0] for law in laws.along(speed[:, None])), *linear], axis=1)
    torque = shapes @ size
    variance = np.einsum("si,ij,sj->s", shapes, covariance, shapes).mean()
    variance = max(variance, EXACT**2 * float((torque**2).mean()), np.finfo(float).tiny)
    precision = len(size) / (variance * len(speed))

    def at(log_width: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sizes of the file's terms, the terms, and the torque that is left."""
        terms = np.stack([np.tanh(speed / np.exp(log_width)), *linear], axis=1)
        found = np.linalg.lstsq(terms, torque, rcond=None)[0]
        return found, terms, torque - terms @ found

    def cost(log_width: float) -> float:
        left = at(log_width)[2]
        deviation = (log_width - np.log(told_width)) / WIDTH_DEVIATION
        return float(precision * (left @ left) + deviation**2)

    log_width = float(np.log(told_width))
    if not held:
        log_width = _least(cost, log_width, FARTHEST * WIDTH_DEVIATION)
    found, terms, left = at(log_width)
    width = float(np.exp(log_width))
    # What each number does to the torque, and one row more, the prior of the logarithm of `speed`.
    steepness = -found[0] * (1 - terms[:, 0] ** 2) * speed / width**2
    doing = {"coulomb": terms[:, 0], "offset": terms[:, 1]}
    doing |= {} if held else {"speed": steepness}
    doing |= {"viscous": terms[:, 2]} if len(linear) > 1 else {}
    names, columns = tuple(doing), np.sqrt(precision) * np.stack(list(doing.values()), axis=1)
    prior = np.array([1 / (WIDTH_DEVIATION * width) if name == "speed" else 0.0 for name in names])
    rows = np.vstack((columns, prior))
    size_of = np.sqrt((rows**2).sum(axis=0))
    scale = 1 / np.where(size_of > 0, size_of, 1.0)
    inverse = np.linalg.pinv(rows * scale) * scale[:, None]
    values = {"coulomb": found[0], "offset": found[1], "speed": width, "viscous": found[-1]}
    slope = np.sqrt(precision) * inverse[:, :-1] @ shapes
    # What another shape leaves counts as noise does (Birge, Physical Review 40, 1932).
    excess = max(0.0, float((left**2).mean()) / variance - 1)
    return NearestFriction(
        width=width,
        names=names,
        value=np.array([values[name] for name in names]),
        slope=slope,
        beyond=np.outer(inverse[:, -1], inverse[:, -1]) + excess * slope @ covariance @ slope.T,
        size=float(np.sqrt((torque**2).mean())),
        left=float(np.sqrt((left**2).mean())),
        uncertainty=float(np.sqrt(variance)),
    )


def _spread(speed: FloatArray) -> FloatArray:
    """Return a part of the speeds that is spread as all of them are."""
    ordered = np.sort(speed)
    chosen = np.linspace(0, len(ordered) - 1, min(SPEEDS, len(ordered)))
    spread: FloatArray = ordered[chosen.round().astype(int)]
    return spread


def _least(cost: Callable[[float], float], middle: float, reach: float) -> float:
    """Return where a cost is least within `reach` of the middle: the best of a grid, refined."""
    grid = middle + np.linspace(-reach, reach, GRID)
    best = grid[int(np.argmin([cost(float(one)) for one in grid]))]
    step = grid[1] - grid[0]
    found = scipy.optimize.minimize_scalar(
        cost, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-6}
    )
    return float(found.x)
