"""Motor torque to motor acceleration, (2.7) in second-order form, as a sampled controller sees it.

``G(w) = (i w)^2 B^T Z(w)^-1 B`` with ``Z = K - w^2 M + i w D``, symmetric. The derivative with respect to spring
s is a rank-one product of transfer vectors from the same factorisation, ``-(i w)^2 x_s x_s^T``, ``x_s = B^T Z^-1
e_s``. Sign of frequency as in numpy's DFT: exp(+i w t) turns forward.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import FloatArray
from robid_core.mechanics.kernel import kernel
from robid_core.mechanics.layout import padded_rows
from robid_core.mechanics.linearize import SecondOrderModel

ComplexArray = npt.NDArray[np.complex128]


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
    position, _, frequency = _position(model, omega, model.spring_directions[:0])
    return _sampled(model, position, frequency, hold_sample_time)


def response_with_gradient(
    model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None = None
) -> ResponseGradient:
    """Response as `response` gives it, and the factors of its derivatives at fixed equilibrium."""
    position, deflection, frequency = _position(model, omega, model.spring_directions)
    hold, _ = hold_factor(frequency, hold_sample_time)
    scale = (1j * frequency * np.sqrt(hold))[:, None, None]
    sampled = _sampled(model, position, frequency, hold_sample_time)
    return ResponseGradient(sampled, scale * deflection, scale * position)


def hold_factor(omega: FloatArray, sample_time: float | None) -> tuple[ComplexArray, ComplexArray]:
    """H0 and the factor of the images of a pure inertia (see `response`), each of the shape of omega."""
    if sample_time is None:
        return np.ones(omega.shape, dtype=np.complex128), np.zeros(omega.shape, dtype=np.complex128)
    x = omega * sample_time / 2
    half_sample = np.exp(-1j * x)
    return half_sample * np.sin(x) / x, half_sample * (x**2 * np.cos(x) / np.sin(x) ** 2 - np.sin(x) / x)


def _position(
    model: SecondOrderModel, omega: FloatArray, springs: FloatArray
) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Motor angles and spring deflections over motor torque, and the frequencies."""
    frequency = np.array(omega, dtype=np.float64, order="C")
    if frequency.ndim != 1 or not (np.isfinite(frequency) & (frequency > 0)).all():
        raise ConfigurationError("response: frequencies must be finite and above zero, in one row")
    n, leading = model.mass.shape[-1], model.mass.shape[:-2]
    parts = (model.mass, model.damping, model.stiffness)
    matrices = [np.array(part, dtype=np.float64, order="C").reshape(-1, n, n) for part in parts]
    shape = (len(matrices[0]), len(frequency))
    position = np.empty((*shape, model.n_axis, model.n_axis), dtype=np.complex128)
    deflection = np.empty((*shape, len(springs), model.n_axis), dtype=np.complex128)
    position_response(*matrices, frequency, *padded_rows(springs), position, deflection)
    rows = (*leading, len(frequency))
    return (
        position.reshape(*rows, *position.shape[2:]),
        deflection.reshape(*rows, *deflection.shape[2:]),
        frequency,
    )


def _sampled(
    model: SecondOrderModel, position: ComplexArray, omega: FloatArray, hold_sample_time: float | None
) -> ComplexArray:
    hold, image = hold_factor(omega, hold_sample_time)
    inertial = np.linalg.inv(model.mass)[..., None, : model.n_axis, : model.n_axis]
    sampled: ComplexArray = (-(omega**2) * hold)[:, None, None] * position + image[:, None, None] * inertial
    return sampled


@kernel
def position_response(  # type: ignore[no-untyped-def]
    mass, damping, stiffness, omega, spring_column, spring_value, position, deflection
):
    """Motor angles, and deflections of springs, over motor torque for every configuration and frequency.

    Z = U D U^T from the last coordinate up: right-hand sides are then nonzero in the first block only, and only the
    first block is needed where no deflection is asked for. Without pivoting: damping keeps the pivots off zero
    (growth is bounded by one over the damping ratio). Contiguous arrays: (n_config, n, n) three times, (n_freq,),
    `padded_rows` of the spring directions, (n_config, n_freq, n_axis, n_axis), (n_config, n_freq, n_spring, n_axis).
    """
    n, n_axis, n_spring = mass.shape[1], position.shape[2], deflection.shape[2]
    rows = n if n_spring > 0 else n_axis
    z = np.empty((n, n), dtype=np.complex128)
    inverse = np.empty(n, dtype=np.complex128)
    x = np.empty(n, dtype=np.complex128)
    for config in range(mass.shape[0]):
        for line in range(omega.shape[0]):
            w = omega[line]
            for i in range(n):
                for j in range(i + 1):
                    real = stiffness[config, i, j] - w * w * mass[config, i, j]
                    z[i, j] = complex(real, w * damping[config, i, j])
            for k in range(n - 1, -1, -1):
                inverse[k] = 1.0 / z[k, k]
                for i in range(k):
                    factor = z[k, i] * inverse[k]
                    for j in range(i + 1):
                        z[i, j] -= factor * z[k, j]
                for i in range(k):
                    z[k, i] *= inverse[k]
            for motor in range(n_axis):
                # U y = e_motor upwards, then D, then U^T x = y downwards
                for i in range(rows):
                    x[i] = 0.0
                x[motor] = 1.0
                for k in range(motor, -1, -1):
                    for i in range(k):
                        x[i] -= z[k, i] * x[k]
                for i in range(motor + 1):
                    x[i] *= inverse[i]
                for k in range(rows):
                    for i in range(k):
                        x[k] -= z[k, i] * x[i]
                for i in range(n_axis):
                    position[config, line, i, motor] = x[i]
                for s in range(n_spring):
                    total = 0.0 * x[0]
                    for e in range(spring_column.shape[1]):
                        total += spring_value[s, e] * x[spring_column[s, e]]
                    deflection[config, line, s, motor] = total
