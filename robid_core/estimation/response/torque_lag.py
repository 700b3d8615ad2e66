"""By how many samples recorded torques lag recorded motion, from the phase against what a model makes of the torques.

A torque that was recorded d samples late puts the predicted acceleration behind the recorded one by the phase w d T.
Errors of springs and bodies turn the phase only between a wrong resonance and the right one, and friction the less, the
higher the frequency: so the slope of the phase is taken robustly, by least absolute deviations, and high up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray

FARTHEST = 20.0  # samples that are searched, either way
ROUNDS = 40  # of reweighting
SMOOTHING = 0.05  # of the scatter, below which a deviation counts as its square
NORMAL = 1.4826  # standard deviation per median absolute one
NEIGHBOURS = 4.0  # bins of a windowed spectrum that share their noise


@dataclass(frozen=True)
class Lag:
    """Lag of a torque behind the motion."""

    samples: float
    error: float
    """Standard error, samples, from the scatter over the bins."""
    scatter: float
    """Of the phase about the lag's, rad."""


def torque_lag(omega: FloatArray, phase: FloatArray, sample_time_s: float) -> Lag:
    """Return the lag of a torque behind the motion that it makes.

    Parameters
    ----------
    omega
        Angular frequencies in rad/s, (n,), in any order and as often as there were experiments.
    phase
        Of the recorded acceleration over the predicted one, rad, (n,).
    sample_time_s
        T.
    """
    turn = omega * sample_time_s
    tried = np.arange(-FARTHEST, FARTHEST + 0.05, 0.1)
    start = float(tried[np.argmax(np.cos(phase - turn * tried[:, None]).sum(axis=1))])
    rest = np.angle(np.exp(1j * (phase - turn * start)))
    more, weight = 0.0, np.ones(len(turn))
    for _ in range(ROUNDS):
        more = float((weight * turn * rest).sum() / (weight * turn**2).sum())
        deviation = np.abs(rest - turn * more)
        scatter = NORMAL * float(np.median(deviation))
        weight = 1 / np.maximum(deviation, SMOOTHING * scatter + 1e-12)
    # Of normal errors a median has pi/2 times the variance of a mean.
    error = scatter * np.sqrt(0.5 * np.pi * NEIGHBOURS / (turn**2).sum())
    return Lag(start + more, float(error), scatter)


def lag_beside_friction(omega: FloatArray, phase: FloatArray, sample_time_s: float) -> Lag:
    """Return the lag of a torque where friction may turn the phase, too, as of a single axis nothing else tells.

    Friction and damping that the model lacks turn the phase of a motor above its corner by about c / w; a lag turns it
    by w d T. Both are found together by least squares, so that the standard error counts what they share; deviations
    that are no noise make it larger.

    Parameters
    ----------
    omega, phase, sample_time_s
        As of `torque_lag`.
    """
    rough = torque_lag(omega, phase, sample_time_s)
    turn = omega * sample_time_s
    rest = np.angle(np.exp(1j * (phase - turn * rough.samples)))
    columns = np.stack([turn, 1 / turn], axis=1)
    found = np.linalg.lstsq(columns, rest, rcond=None)[0]
    free = len(turn) / NEIGHBOURS - 2
    scatter = np.sqrt(((rest - columns @ found) ** 2).sum() / NEIGHBOURS / free) if free > 0 else np.inf
    variance = NEIGHBOURS * np.linalg.inv(columns.T @ columns)[0, 0]
    return Lag(rough.samples + float(found[0]), float(scatter * np.sqrt(variance)), float(scatter))
