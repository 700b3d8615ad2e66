"""Innovations of a linear predictor along a record, and what their likelihood says about its parameters.

``x' = A x + B u + K e``, ``e = y - C x`` (L. Ljung, System Identification, 1999, section 4.3), from an initial state
that is estimated with each lane by least squares. The derivative of the innovations for a parameter runs
through the same predictor, ``x_i' = F x_i + A_i x + B_i u + K_i e``, ``e_i = -C x_i``, ``F = A - K C``. Information is
that of Gaussian innovations: ``sum e_i' S^-1 e_j + n / 2 tr(S^-1 S_i S^-1 S_j)``, less what the initial states explain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray

BLOCK = 128  # samples whose derivatives are held at once
INVISIBLE = (
    1e-12  # of the scaled information about an initial state: directions that nothing shows stay at zero
)


@dataclass(frozen=True, eq=False)
class Predictor:
    """A, B, C and K of a predictor, and the covariance S of its innovations."""

    transition: FloatArray
    """(n_state, n_state)."""
    input: FloatArray
    """(n_state, n_input)."""
    output: FloatArray
    """(n_output, n_state)."""
    gain: FloatArray
    """(n_state, n_output)."""
    innovation: FloatArray
    """(n_output, n_output)."""


@dataclass(frozen=True, eq=False)
class PredictorSlopes:
    """Derivatives of a predictor, the parameter first; C does not depend on it."""

    transition: FloatArray
    input: FloatArray
    gain: FloatArray
    innovation: FloatArray


@dataclass(frozen=True, eq=False)
class Prediction:
    """One-step predictions of a predictor, from inputs and outputs."""

    state: FloatArray
    """Predicted states, shape (n_sample, n_lane, n_state)."""
    innovation: FloatArray
    """Outputs less their predictions, shape (n_sample, n_lane, n_output)."""
    of_start: FloatArray
    """Outputs that unit initial states make (see `free_outputs`), shape (n_sample, n_state, n_output)."""


def predict(model: Predictor, u: FloatArray, y: FloatArray) -> Prediction:
    """Predict each sample from those before it, from the initial states that fit best.

    Parameters
    ----------
    model
        The predictor.
    u, y
        Inputs and outputs, shapes (n_sample, n_lane, n_input) and (n_sample, n_lane, n_output).
    """
    (n_sample, n_lane, _), n_state = y.shape, len(model.transition)
    shown = free_outputs(model, n_sample)
    weighted = shown @ np.linalg.inv(model.innovation)  # (n_sample, n_state, n_output)
    states = _states(model, u, y, np.zeros((n_lane, n_state)))
    score = np.einsum("tso,tlo->sl", weighted, y - states @ model.output.T)
    states = _states(model, u, y, (_inverse_of_shown(weighted, shown) @ score).T)
    return Prediction(states, y - states @ model.output.T, shown)


def free_outputs(model: Predictor, n_sample: int) -> FloatArray:
    """Outputs that unit initial states make in the predictor's own motion, shape (n_sample, n_state, n_output)."""
    power = np.eye(len(model.transition))
    turn = (model.transition - model.gain @ model.output).T
    found = np.empty((n_sample, len(power), len(model.output)))
    for t in range(n_sample):
        found[t] = power @ model.output.T
        power = power @ turn
    return found


def log_likelihood_cost(model: Predictor, prediction: Prediction) -> float:
    """``1/2 sum (e' S^-1 e + log det S)``, without the constant."""
    e = prediction.innovation.reshape(-1, len(model.innovation))
    scaled = e @ np.linalg.inv(model.innovation)
    return 0.5 * float((scaled * e).sum()) + 0.5 * len(e) * float(np.linalg.slogdet(model.innovation)[1])


def likelihood_equations(
    model: Predictor, slopes: PredictorSlopes, u: FloatArray, prediction: Prediction
) -> tuple[FloatArray, FloatArray]:
    """Gradient of `log_likelihood_cost` (n,) and information (n, n), the initial states estimated beside.

    Parameters
    ----------
    model, slopes
        The predictor and its derivatives.
    u
        Inputs, as for `predict`.
    prediction
        Its result.
    """
    x, e = prediction.state, prediction.innovation
    (n_sample, n_lane, n_state), n, n_output = x.shape, len(slopes.transition), e.shape[2]
    inverse = np.linalg.inv(model.innovation)
    root = np.linalg.cholesky(inverse)
    turn = (model.transition - model.gain @ model.output).T
    drive = np.concatenate((slopes.transition, slopes.input, slopes.gain), axis=2)
    drive = drive.transpose(2, 0, 1).reshape(drive.shape[2], n * n_state)
    shown = prediction.of_start @ root
    rows, own = np.zeros((n_lane * n, n_state)), np.zeros((n_lane, n_state, n))
    gradient, information = np.zeros(n), np.zeros((n, n))
    for first in range(0, n_sample, BLOCK):
        part = slice(first, first + BLOCK)
        told = np.concatenate((x[part], u[part], e[part]), axis=2)
        forced = (told.reshape(-1, told.shape[2]) @ drive).reshape(len(told), n_lane * n, n_state)
        moved = np.empty((len(told), n_lane * n, n_output))
        for t, force in enumerate(forced):
            moved[t] = rows @ model.output.T
            rows = rows @ turn + force
        white = -(moved.reshape(-1, n_output) @ root).reshape(len(told), n_lane, n, n_output)
        flat = np.ascontiguousarray(white.transpose(0, 1, 3, 2))  # (n_sample, n_lane, n_output, n)
        gradient += (e[part] @ root).reshape(-1) @ flat.reshape(-1, n)
        information += flat.reshape(-1, n).T @ flat.reshape(-1, n)
        own += np.einsum("tso,tlon->lsn", shown[part], flat, optimize=True)
    information -= np.einsum("lsn,st,ltm->nm", own, _inverse_of_shown(shown, shown), own, optimize=True)
    turned = inverse @ slopes.innovation
    count, flat_e = n_sample * n_lane, e.reshape(-1, n_output)
    power = inverse @ (flat_e.T @ flat_e)
    gradient += 0.5 * count * np.trace(turned, axis1=1, axis2=2) - 0.5 * np.einsum("nij,ji->n", turned, power)
    information += 0.5 * count * np.einsum("nij,mji->nm", turned, turned)
    return gradient, information


def _states(model: Predictor, u: FloatArray, y: FloatArray, start: FloatArray) -> FloatArray:
    """Predicted states from given initial ones, (n_sample, n_lane, n_state)."""
    turn = (model.transition - model.gain @ model.output).T
    forced = u @ model.input.T + y @ model.gain.T
    states = np.empty((len(y), *start.shape))
    state = start
    for t, force in enumerate(forced):
        states[t] = state
        state = state @ turn + force
    return states


def _inverse_of_shown(left: FloatArray, right: FloatArray) -> FloatArray:
    """Inverse information about an initial state, (n_state, n_state); zero for what nothing shows."""
    matrix = np.tensordot(left, right, axes=((0, 2), (0, 2)))
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    inverse: FloatArray = np.linalg.pinv(
        matrix / np.outer(scale, scale), rcond=INVISIBLE, hermitian=True
    ) / np.outer(scale, scale)
    return inverse
