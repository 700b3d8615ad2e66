"""How far a measured response will scatter, predicted from experiments that were only simulated.

The scatter has two sources. Friction and whatever else is not linear shows in a simulation without noise: it is what
the least-squares response leaves of the simulated outputs, as for a measured record (`covariance.residual_products`).
Noise of the sensors is white and known, and adds to it: ``V = Y - G U`` of one experiment and one period has the
covariance ``w^4 diag(s_q^2) + G diag(s_u^2) G^H``, over the number of samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.response.covariance import pool_lines, residual_products
from robid_core.estimation.response.spectra import factor_inputs


@dataclass(frozen=True)
class SensorNoise:
    """White noise of the sensors, every field of shape (n_axis,), motor side."""

    position: FloatArray
    """Variance of the measured angle, rad^2."""
    torque: FloatArray
    """Variance of the measured torque, (N m)^2."""
    steps: FloatArray
    """Variance that the steps of the encoder add to the angle, step^2 / 12, rad^2."""


@dataclass(frozen=True)
class PredictedDeviation:
    """Relative standard deviation of the diagonal of G, shapes (n_freq, n_axis); NaN where U is singular."""

    total: FloatArray
    """Of noise and distortion."""
    noise: FloatArray
    """Of the sensors alone."""


def noise_covariance(
    response: ComplexArray,
    frequency_hz: FloatArray,
    position_variance: FloatArray,
    torque_variance: FloatArray,
    n_sample: int,
) -> ComplexArray:
    """Covariance of ``V = Y - G U`` that the sensors cause in one period.

    ``(w^4 diag(s_q^2) + G diag(s_u^2) G^H) / n_sample``. Noise of the angle moves the controller and through it U and
    Y along G; that leaves V alone.

    Parameters
    ----------
    response
        G, (rad/s^2)/(N m), shape (..., n_freq, n_axis, n_axis).
    frequency_hz
        Shape (n_freq,).
    position_variance, torque_variance
        rad^2 and (N m)^2, shape (n_axis,).
    n_sample
        Samples of a period.

    Returns
    -------
    (rad/s^2)^2, DFT scaled by 1 / n_sample, shape of `response`.
    """
    fourth = ((2 * np.pi * frequency_hz) ** 4)[:, None, None]
    torque = (response * torque_variance) @ response.conj().swapaxes(-1, -2)
    result: ComplexArray = (fourth * np.diag(position_variance) + torque) / n_sample
    return result


def predicted_deviation(
    u: ComplexArray,
    y: ComplexArray,
    n_planned: int,
    frequency_hz: FloatArray,
    noise: SensorNoise,
    n_sample: int,
) -> PredictedDeviation | None:
    """Relative standard deviation of an averaged response from simulated experiments without noise.

    The covariance of vec(G) is ``(U U^H)^-T (x) C_V`` with U of the planned experiments, one period each, and C_V the
    pooled residuals of all simulated ones plus the noise of the sensors. Steps of the encoder are in the residuals
    already.

    Parameters
    ----------
    u, y
        Simulated spectra, DFT scaled by 1 / n_sample, N m and rad/s^2, shape (n_freq, n_axis, n_exp).
    n_planned
        How many of them, the first ones, will be measured; the others serve the scatter only.
    frequency_hz
        Shape (n_freq,).
    noise
        Of the sensors.
    n_sample
        Samples of a period.

    Returns
    -------
    None where the planned experiments are fewer than the axes, or the simulated ones too few for a scatter: an
    average of experiments gives no response or no covariance then.
    """
    n_axis, n_exp = u.shape[-2:]
    weight = n_exp - n_axis
    if n_planned < n_axis or weight < 1:
        return None
    factors = factor_inputs(u)
    response = y @ factors.inverse
    valid = np.asarray(np.isfinite(response).all(axis=(-2, -1)))
    pooled = pool_lines(
        residual_products(u, y, factors.inverse)[None],
        weight,
        valid[None],
        np.mean(np.abs(y) ** 2, axis=-1)[None],
        response[None],
        frequency_hz,
    )
    if pooled is None:
        return None
    inputs = np.einsum("kaa->ka", factor_inputs(u[..., :n_planned]).gram_inverse).real
    size = np.abs(np.einsum("kaa->ka", response))

    def relative(covariance: ComplexArray) -> FloatArray:
        outputs = np.einsum("kaa->ka", covariance).real
        deviation: FloatArray = np.sqrt(outputs * inputs) / size
        return deviation

    sensors = noise_covariance(response, frequency_hz, noise.position, noise.torque, n_sample)
    with_steps = noise_covariance(
        response, frequency_hz, noise.position + noise.steps, noise.torque, n_sample
    )
    return PredictedDeviation(relative(pooled.covariance[0] + sensors), relative(with_steps))
