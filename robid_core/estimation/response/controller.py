"""The drives' controller as a frequency response: from references and measured angle to the torque asked for.

The sampled cascade of `robid_core.mechanics.closed_loop`, one axis at a time: speed error
``e = k_f w + k_p (p - q) - (q - q z^-1) / T`` of the speed reference w, the position reference p (where none is
given, the integral of w: ``p = T w / (z - 1)``) and the measured angle q, and a proportional-integral law on it
whose integral has seen the present error, ``u = (K + K_i T z / (z - 1)) e``, held for one sample. At a line,
``z = exp(i w T)``. What is constant (gravity's holding torque, an initial angle) has no part in it; a torque limit
that is met makes it wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray


class Gains(Protocol):
    """Gains of each axis, shape (n_axis,): drives of a robot, or a controller of `robid_core.mechanics`."""

    @property
    def speed_gain(self) -> FloatArray:
        """K, N m s/rad."""

    @property
    def integral_gain(self) -> FloatArray:
        """K_i, N m/rad."""

    @property
    def position_gain(self) -> FloatArray:
        """k_p, 1/s."""

    @property
    def speed_feedforward(self) -> FloatArray:
        """k_f, share of the speed reference that enters the error."""


@dataclass(frozen=True)
class ControllerResponse:
    """Torque over each signal of the same axis, shape (n_freq, n_axis): ``u = W w + P p - Q q``.

    `from_speed` assumes that the position reference is given apart; `from_speed_alone` that it is the integral
    of the speed reference.
    """

    from_speed: ComplexArray
    from_speed_alone: ComplexArray
    from_position: ComplexArray
    from_angle: ComplexArray


def controller_response(gains: Gains, sample_time_s: float, frequency_hz: FloatArray) -> ControllerResponse:
    """Frequency response of the controller at frequencies (n_freq,), positive and below half the sample rate."""
    step = sample_time_s
    z = np.exp(2j * np.pi * np.asarray(frequency_hz)[:, None] * step)
    law = gains.speed_gain + gains.integral_gain * step * z / (z - 1)
    from_position = law * gains.position_gain
    from_speed = law * gains.speed_feedforward
    return ControllerResponse(
        from_speed=from_speed,
        from_speed_alone=from_speed + from_position * step / (z - 1),
        from_position=from_position,
        from_angle=from_position + law * (1 - 1 / z) / step,
    )


def feedback_from_acceleration(response: ControllerResponse, frequency_hz: FloatArray) -> ComplexArray:
    """F of ``u = d - F y``, y the acceleration ``(i w)^2 q``; shape (n_freq, n_axis)."""
    omega = 2 * np.pi * np.asarray(frequency_hz)[:, None]
    result: ComplexArray = response.from_angle / -(omega**2)
    return result


def drive_signal(
    response: ControllerResponse, speed: ComplexArray, position: ComplexArray | None = None
) -> ComplexArray:
    """Torque d that the references ask for, whatever the motors do.

    Parameters
    ----------
    response
        At the lines.
    speed, position
        Spectra of the references, shape (..., n_freq, n_axis, n_exp); without a position reference it is the
        integral of the speed reference.

    Returns
    -------
    Shape of the spectra, N m.
    """
    if position is None:
        return response.from_speed_alone[:, :, None] * speed
    result: ComplexArray = response.from_speed[:, :, None] * speed
    return result + response.from_position[:, :, None] * position
