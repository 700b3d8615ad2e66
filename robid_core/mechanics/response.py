"""Motor torque to motor acceleration, (2.7) in second-order form, as a sampled controller sees it.

``G(w) = (i w)^2 B^T Z(w)^-1 B`` with ``Z = K - w^2 M + i w D``, symmetric. The derivative with respect to spring
s is a rank-one product of transfer vectors from the same factorisation, ``-(i w)^2 x_s x_s^T``, ``x_s = B^T Z^-1
e_s``. Sign of frequency as in numpy's DFT: exp(+i w t) turns forward.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.compiled.lanes import LANES
from robid_core.errors import ConfigurationError
from robid_core.mechanics.condensation import condense, memory_of
from robid_core.mechanics.elimination import plan_of
from robid_core.mechanics.linearize import SecondOrderModel


@dataclass(frozen=True)
class ResponseGradient:
    """Response and the vectors that its derivatives are made of; ``(i w) sqrt(H0)`` is folded into them.

    With x one row of `spring_vectors` or `motor_vectors` (shape (n_axis,)) and x x^T its outer product:
    d response / d stiffness = - x x^T; d response / d damping = - i w x x^T; for a motor's rotor inertia + w^2 x x^T
    (but for the part of it in the folded images, below 1e-3 of the response under a tenth of the sampling rate).
    """

    response: ComplexArray
    """(rad/s^2)/(N m), shape (..., n_freq, n_axis, n_axis), [output, input]."""
    spring_vectors: ComplexArray
    """Shape (..., n_freq, n_spring, n_axis)."""
    motor_vectors: ComplexArray
    """Shape (..., n_freq, n_axis, n_axis), [motor, :]."""


def response(
    model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None = None
) -> ComplexArray:
    """Frequency response matrix from motor torque to motor acceleration.

    Without `hold_sample_time` that of the continuous system. With it (T), torque is held from one sampling
    instant to the next and position is sampled at the instant; acceleration is (i w)^2 times the spectrum of the
    sampled position:

    ``G(w) H0(w) + (images)``,  ``H0 = exp(-i x) sin(x) / x``, ``x = w T / 2``.

    The images are the response at w + n w_s, n != 0, w_s = 2 pi / T. There the inertia rules, P(s) = J / s^2 with
    J = B^T M^-1 B, and the sum has a closed form, that of the sampled double integrator T^2 (z + 1) / (2 (z - 1)^2):
    ``(images) = J exp(-i x) (x^2 cos(x) / sin(x)^2 - sin(x) / x)``. What is neglected are the images of
    P(s) - J / s^2 = -J_D / s^3 + O(s^-4), J_D = B^T M^-1 D M^-1 B: at most
    ``2.2 |J_D| w^3 / w_s^4 / (1 - w / w_s)^4`` and the like of the stiffness, ``5.1 |J_K| w^4 / w_s^6 / (...)^6``,
    J_K = B^T M^-1 K M^-1 B: 1e-5 of J at 80 Hz and 1 kHz for motors that friction alone would stop in 0.1 s.

    Parameters
    ----------
    model
        Linear model at one or many configurations.
    omega
        Angular frequencies, rad/s, > 0, shape (n_freq,).
    hold_sample_time
        Control and sampling period, s; None is the continuous response.

    Returns
    -------
    (rad/s^2)/(N m), shape (..., n_freq, n_axis, n_axis), [output, input].
    """
    return _condensed(model, omega, hold_sample_time, gradient=False).response


def response_with_gradient(
    model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None = None
) -> ResponseGradient:
    """Response as `response` gives it, and the factors of its derivatives at fixed equilibrium."""
    return _condensed(model, omega, hold_sample_time, gradient=True)


def with_motor_impedance(
    plain: ResponseGradient, impedance: ComplexArray, omega: FloatArray, hold_sample_time: float | None = None
) -> ResponseGradient:
    """Response and vectors with something more at the motors, whatever its course over frequency.

    With ``P = B^T Z^-1 B`` and Y the diagonal of impedances, ``B^T (Z + B Y B^T)^-1 = (I + P Y)^-1 B^T Z^-1``: nothing
    is factorised again. The folded images, where the inertia rules, are left as they are.

    Parameters
    ----------
    plain
        From `response_with_gradient`.
    impedance
        Torque per motor angle, N m/rad, shape (..., n_freq, n_axis).
    omega, hold_sample_time
        As for `plain`.
    """
    scale = 1j * omega * np.sqrt(hold_factor(omega, hold_sample_time)[0])
    between = plain.motor_vectors / scale[:, None, None]
    turned = np.linalg.inv(np.eye(impedance.shape[-1]) + between * impedance[..., None, :])
    motors = turned @ plain.motor_vectors
    return ResponseGradient(
        plain.response + scale[:, None, None] * (motors - plain.motor_vectors),
        plain.spring_vectors @ np.swapaxes(turned, -1, -2),
        motors,
    )


def hold_factor(omega: FloatArray, sample_time: float | None) -> tuple[ComplexArray, ComplexArray]:
    """H0 and the factor of the images of a pure inertia (see `response`), each of the shape of omega."""
    if sample_time is None:
        return np.ones(omega.shape, dtype=np.complex128), np.zeros(omega.shape, dtype=np.complex128)
    x = omega * sample_time / 2
    half_sample = np.exp(-1j * x)
    return half_sample * np.sin(x) / x, half_sample * (x**2 * np.cos(x) / np.sin(x) ** 2 - np.sin(x) / x)


def _condensed(
    model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None, gradient: bool
) -> ResponseGradient:
    """Response, and where `gradient` the vectors (else of no rows)."""
    frequency = np.asarray(omega, dtype=np.float64)
    if frequency.ndim != 1 or not (np.isfinite(frequency) & (frequency > 0)).all():
        raise ConfigurationError("response: frequencies must be finite and above zero, in one row")
    (n, n_axis), leading = model.input_map.shape, model.mass.shape[:-2]
    mass, damping, stiffness = (
        np.require(part, np.float64, ["C", "W"]).reshape(-1, n, n)
        for part in (model.mass, model.damping, model.stiffness)
    )
    border = np.concatenate((model.input_map.T, model.spring_directions[: None if gradient else 0]))
    plan = plan_of(mass, damping, stiffness, border, n_axis)
    n_config, n_pair = len(mass), len(plan.motor)
    inertial = np.zeros((n_config, n_pair))
    sizes = (n_axis, len(border) - n_axis, n_axis if gradient else 0)
    results = [np.empty((n_config, len(frequency), size * n_axis), dtype=np.complex128) for size in sizes]
    lines = _lines(frequency, hold_sample_time)
    condense(plan, mass, damping, stiffness, border, lines, memory_of(plan), inertial, *results)
    if hold_sample_time is not None and not np.isfinite(inertial).all():
        config = int(np.argmin(np.isfinite(inertial).all(axis=1)))
        raise ConfigurationError(
            f"response: configuration {config + 1}: the mass matrix is singular, some coordinate moves no mass; give "
            "what hangs on it a mass"
        )
    return ResponseGradient(
        *(
            result.reshape(*leading, len(frequency), size, n_axis)
            for result, size in zip(results, sizes, strict=True)
        )
    )


def _lines(omega: FloatArray, sample_time: float | None) -> FloatArray:
    """Coefficients of the lines for `condense`, shape (n_batch, 9, LANES); the last one fills up the lanes.

    With E times c, ``c^2 = - i w sqrt(H0)``, results between motors are the motor vectors x; then
    ``response = i w sqrt(H0) x + (factor of the images) J``. J is the result with Z = M and c = i, in lane 0.
    """
    if not len(omega):
        return np.zeros((0, 9, LANES))
    n_batch = -(-(1 + len(omega)) // LANES)
    w = omega[np.clip(np.arange(-1, n_batch * LANES - 1), 0, len(omega) - 1)]
    hold, image = hold_factor(w, sample_time)
    scale = 1j * w * np.sqrt(hold)
    border = np.sqrt(-scale)
    parts = (scale.real, scale.imag, image.real, image.imag)
    table = np.array([np.ones_like(w), -(w**2), w, border.real, border.imag, *parts])
    if sample_time is not None:
        table[:5, 0] = 0.0, 1.0, 0.0, 0.0, 1.0
    return np.ascontiguousarray(table.reshape(9, n_batch, LANES).transpose(1, 0, 2))
