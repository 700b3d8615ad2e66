"""Frequency responses of many configurations and lines at once: one batched solve of complex matrices.

``G(w) = (i w)^2 B^T Z(w)^-1 B`` with ``Z = K - w^2 M + i w D``, sampled as `robid_core.mechanics.response` says;
spring deflections over torque come from the same factorisation. Elimination is with pivoting (LAPACK, cuSOLVER), the
batch is cut so that it fits into a stated memory.
"""

from __future__ import annotations

import numpy as np
import torch  # type: ignore[import-not-found, unused-ignore]

from robid_core import ConfigurationError, FloatArray
from robid_core.mechanics import ResponseGradient, SecondOrderModel
from robid_core.mechanics.response import hold_factor
from robid_torch.trees import tensor


def gradient_of_lines(
    model: SecondOrderModel,
    omega: FloatArray,
    hold_sample_time: float | None,
    device: torch.device,
    memory_bytes: int,
) -> ResponseGradient:
    """Response and the factors of its derivatives, as `robid_core.mechanics.response_with_gradient` gives them.

    Parameters
    ----------
    model
        Linear model at one or many configurations.
    omega
        Angular frequencies, rad/s, > 0, shape (n_freq,).
    hold_sample_time
        Control and sampling period, s; None is the continuous response.
    device
        Where to compute.
    memory_bytes
        How much of the device's memory the matrices of one batch may take.

    Raises
    ------
    ConfigurationError
        For a frequency that is not positive and finite.
    """
    frequency = np.asarray(omega, dtype=np.float64)
    if frequency.ndim != 1 or not (np.isfinite(frequency) & (frequency > 0)).all():
        raise ConfigurationError("response: frequencies must be finite and above zero, in one row")
    n, leading = model.mass.shape[-1], model.mass.shape[:-2]
    mass, damping, stiffness = (
        tensor(part.reshape(-1, n, n), device) for part in (model.mass, model.damping, model.stiffness)
    )
    inputs, springs = tensor(model.input_map, device), tensor(model.spring_directions, device)
    hold, image = (
        torch.tensor(factor, device=device)[:, None, None]
        for factor in hold_factor(frequency, hold_sample_time)
    )
    w = tensor(frequency, device)[:, None, None]
    inertial = inputs.T @ torch.linalg.solve(mass, inputs.expand(len(mass), -1, -1))
    n_config, n_freq, n_axis = len(mass), len(frequency), model.n_axis
    response = np.empty((n_config * n_freq, n_axis, n_axis), dtype=np.complex128)
    deflection = np.empty((n_config * n_freq, len(springs), n_axis), dtype=np.complex128)
    motor = np.empty_like(response)
    rows = max(1, memory_bytes // bytes_per_line(n, n_axis))
    for start in range(0, n_config * n_freq, rows):
        part = slice(start, min(start + rows, n_config * n_freq))
        row = torch.arange(part.start, part.stop, device=device)
        config, line = row // n_freq, row % n_freq
        at, held = w[line], hold[line]
        impedance = torch.complex(stiffness[config] - at**2 * mass[config], at * damping[config])
        solution = torch.linalg.solve(impedance, inputs.to(impedance.dtype).expand(len(row), -1, -1))
        vectors = 1j * at * torch.sqrt(held) * solution
        moved = inputs.T.to(impedance.dtype) @ solution
        response[part] = (-(at**2) * held * moved + image[line] * inertial[config]).cpu().numpy()
        deflection[part] = (springs.to(impedance.dtype) @ vectors).cpu().numpy()
        motor[part] = (inputs.T.to(impedance.dtype) @ vectors).cpu().numpy()
    shape = (*leading, n_freq)
    return ResponseGradient(
        response.reshape(*shape, n_axis, n_axis),
        deflection.reshape(*shape, len(springs), n_axis),
        motor.reshape(*shape, n_axis, n_axis),
    )


def bytes_per_line(n: int, n_axis: int) -> int:
    """Memory that one configuration and line takes: Z, its factors and a copy, M, K and D, right-hand sides."""
    return n * n * (3 * 16 + 4 * 8) + 6 * 16 * n * n_axis
