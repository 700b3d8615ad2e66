"""Where a prediction breaks the robot's limits, in words, and how much smaller the excitation has to be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import BoolArray, FloatArray, Robot
from robid_excitation.simulated import Prediction


@dataclass(frozen=True)
class Excess:
    """A limit that would be broken, in words, and the factors on both amplitudes that are tried next."""

    lane: int
    words: str
    multisine_factor: float
    sine_factor: float


def excesses(prediction: Prediction, robot: Robot, margin: float) -> list[Excess]:
    """All limits that a prediction breaks, in the worst lane of each axis and quantity.

    `margin` is the share of torque, speed and acceleration limits that may be used; positions may go up to
    their limits.
    """
    limits, p = robot.limits, prediction
    torque_limit = margin * robot.drives.torque_limit
    none = np.zeros_like(p.acceleration)
    return [
        *_peaks("torque", "N m", p.torque, p.slow_torque, torque_limit, robot, p.saturated > 0),
        *_peaks("speed", "rad/s", p.speed, p.slow_speed, margin * limits.speed, robot, none > 0),
        *_peaks(
            "acceleration", "rad/s^2", p.acceleration, none, margin * limits.acceleration, robot, none > 0
        ),
        *_positions("upper", p.upper, limits.upper, p.upper - limits.upper, p.travel, robot),
        *_positions("lower", p.lower, limits.lower, limits.lower - p.lower, p.travel, robot),
    ]


def _peaks(
    name: str,
    unit: str,
    peak: FloatArray,
    slow: FloatArray,
    allowed: FloatArray,
    robot: Robot,
    clipped: BoolArray,
) -> list[Excess]:
    found = []
    for axis in np.flatnonzero((peak > allowed).any(axis=0)):
        lane = int(np.argmax(peak[:, axis]))
        words = (
            f"{robot.axis_names[axis]} would reach a motor {name} of {peak[lane, axis]:.4g} {unit}, "
            f"{allowed[axis]:.4g} {unit} are allowed"
        )
        static = min(slow[lane, axis], peak[lane, axis])
        room = allowed[axis] - static
        # A torque at its limit does not tell how far it wanted to go: halve and look again.
        factor = 0.5 if clipped[lane, axis] else room / max(peak[lane, axis] - static, 1e-300)
        if room < 0.05 * allowed[axis]:  # the slow part alone takes it all
            found.append(Excess(lane, words, 0.7, 0.7))
        else:
            found.append(Excess(lane, words, float(np.clip(0.98 * factor, 0.1, 0.95)), 1.0))
    return found


def _positions(
    name: str, reached: FloatArray, limit: FloatArray, beyond: FloatArray, travel: FloatArray, robot: Robot
) -> list[Excess]:
    found = []
    for axis in np.flatnonzero((beyond > 0).any(axis=0)):
        lane = int(np.argmax(beyond[:, axis]))
        words = (
            f"{robot.axis_names[axis]} would reach a motor angle of {reached[lane, axis]:.4g} rad, beyond its "
            f"{name} limit of {limit[axis]:.4g} rad"
        )
        factor = float(np.clip(0.98 * (1 - beyond[lane, axis] / travel[lane, axis]), 0.1, 0.95))
        found.append(Excess(lane, words, factor, factor))
    return found


def factors_that_fit(
    predict_scaled: Callable[[float, float], Prediction], robot: Robot, margin: float, first: Sequence[Excess]
) -> tuple[float, float] | None:
    """Factors on multisine and slow sine with which a prediction breaks no limit; None where none is found.

    Not extrapolated: the factors that are returned have been simulated.
    """
    multisine = sine = 1.0
    broken: Sequence[Excess] = first
    for _ in range(12):
        multisine *= min(excess.multisine_factor for excess in broken)
        sine *= min(excess.sine_factor for excess in broken)
        broken = excesses(predict_scaled(multisine, sine), robot, margin)
        if not broken:
            return multisine, sine
    return None
