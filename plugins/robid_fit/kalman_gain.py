"""Steady Kalman gain of a sampled linear model, and its derivatives for whatever the model depends on.

The covariance of the predicted state solves the discrete Riccati equation ``P = A P A' - K S K' + Q`` with ``S = C P
C' + R`` and ``K = A P C' S^-1``. It is found by doubling (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, Structure-
preserving algorithms for periodic discrete-time algebraic Riccati equations, 2004), which squares the error in each
round. K minimises P, so that its own change does not count to first order: ``dP = F dP F' + dA P F' + F P dA' + K dR K'
+ dQ`` with ``F = A - K C``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import DataRejected, FloatArray

ROUNDS = 60  # of doubling: poles as near to the unit circle as doubles can tell
SETTLED = 1e-14  # of the largest entry, that a round still changes


@dataclass(frozen=True, eq=False)
class KalmanGain:
    """Gain of the predictor ``x' = A x + B u + K e``, ``e = y - C x``, in its steady state."""

    gain: FloatArray
    """K, shape (n_state, n_output)."""
    innovation: FloatArray
    """Covariance S of the innovations e, shape (n_output, n_output)."""
    state: FloatArray
    """Covariance P of the predicted state, shape (n_state, n_state)."""


def steady_kalman_gain(
    transition: FloatArray, output: FloatArray, process: FloatArray, measurement: FloatArray
) -> KalmanGain:
    """Solve the Riccati equation of the predictor.

    Parameters
    ----------
    transition
        A, shape (n_state, n_state).
    output
        C, shape (n_output, n_state).
    process
        Covariance Q of what disturbs the state from one sample to the next, shape (n_state, n_state).
    measurement
        Variances of the noise of the outputs, > 0, shape (n_output,).

    Raises
    ------
    DataRejected
        Where no steady gain is found: the outputs do not show some state that grows.
    """
    one = np.eye(len(transition))
    a, g, p = transition.T, (output.T / measurement) @ output, process
    with np.errstate(over="ignore", invalid="ignore"):  # of a state that grows unseen
        for _ in range(ROUNDS):
            step = np.linalg.solve(one + g @ p, a)
            grown = a.T @ p @ step
            a, g, p = a @ step, g + a @ np.linalg.solve(one + g @ p, g) @ a.T, p + grown
            p, g = 0.5 * (p + p.T), 0.5 * (g + g.T)
            if not np.isfinite(p).all() or np.abs(grown).max() <= SETTLED * np.abs(p).max():
                break
        else:
            p = np.full_like(p, np.nan)
    if not np.isfinite(p).all():
        raise DataRejected(
            "the state-space model has no steady Kalman gain: the motors' angles do not show some motion that grows; "
            "give the robot springs, dampers or bodies with which it stands"
        )
    innovation = output @ p @ output.T + np.diag(measurement)
    gain = np.asarray(np.linalg.solve(innovation, output @ p @ transition.T), dtype=np.float64).T
    return KalmanGain(gain, innovation, p)


def gain_slopes(
    transition: FloatArray,
    output: FloatArray,
    found: KalmanGain,
    in_transition: FloatArray,
    in_process: FloatArray,
    in_measurement: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of gain and innovation covariance.

    Parameters
    ----------
    transition, output
        A and C, as for `steady_kalman_gain`.
    found
        Its result.
    in_transition, in_process
        Derivatives of A and Q, shape (n, n_state, n_state).
    in_measurement
        Derivatives of the output variances, shape (n, n_output).

    Returns
    -------
    Of K, shape (n, n_state, n_output), and of S, shape (n, n_output, n_output).
    """
    k, s, p = found.gain, found.innovation, found.state
    power = transition - k @ output
    half = in_transition @ (p @ power.T)
    moved = half + half.swapaxes(1, 2) + (k * in_measurement[:, None]) @ k.T + in_process
    for _ in range(ROUNDS):  # dP is the sum of F^i (...) F'^i
        grown = power @ moved @ power.T
        moved = moved + grown
        power = power @ power
        if np.abs(grown).max() <= SETTLED * np.abs(moved).max():
            break
    in_innovation = output @ moved @ output.T
    diagonal = np.arange(len(output))
    in_innovation[:, diagonal, diagonal] += in_measurement
    change: FloatArray = in_transition @ (p @ output.T) + transition @ moved @ output.T - k @ in_innovation
    return np.asarray(np.linalg.solve(s, change.swapaxes(1, 2)), dtype=np.float64).swapaxes(
        1, 2
    ), in_innovation
