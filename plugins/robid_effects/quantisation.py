"""Quantisation: what is reported comes in steps.

Theory: reported = resolution round(true / resolution). Where the signal moves over many steps the error is uniform
and white, of variance resolution^2 / 12, and the gain is 1 (Bennett 1948). For a signal of Gaussian rms s,
amplitude a of a slow sine and mean m the equivalent gain is E[d reported / d true] = 1 + 2 sum_n (-1)^n cos(2 pi n
m / q) exp(-2 (pi n s / q)^2) J0(2 pi n a / q) (Widrow and Kollar 2008): from s = q / 2 on it is 1 within 2 %.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel

N_TERM = 30
SMALLEST_RMS = 0.05
"""Of a step: with it term 30 of the series is exp(-44), and below it the gain is that of one threshold."""


@kernel
def quantisation_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Reported value: the nearest multiple of the resolution."""
    return parameters[0] * np.rint(signal / parameters[0])


def quantiser_gain(
    resolution: float, mean: npt.ArrayLike, rms: npt.ArrayLike, amplitude: npt.ArrayLike
) -> FloatArray:
    """Equivalent gain of a quantiser; mean, rms and amplitude broadcast, in the unit of the resolution.

    An rms below a twentieth of a step counts as a twentieth: a signal that rests has no gain.
    """
    n = np.arange(1, N_TERM + 1)
    mean, rms, amplitude = (
        np.asarray(x, dtype=float)[..., None] / resolution for x in (mean, rms, amplitude)
    )
    terms = (-1.0) ** n * np.cos(2 * np.pi * n * mean) * scipy.special.j0(2 * np.pi * n * amplitude)
    terms = terms * np.exp(-2 * np.square(np.pi * n * np.maximum(rms, SMALLEST_RMS)))
    gain: FloatArray = 1 + 2 * terms.sum(axis=-1)
    return gain


class Quantisation(SignalEffect):
    """Quantisation: rounding to multiples of a resolution."""

    source = "Bennett 1948; Widrow and Kollar 2008, Quantization Noise, chapter 4"
    channels = ("position", "torque_measurement")
    law = staticmethod(quantisation_law)
    parameters = (
        Parameter("resolution", "rad or N m", 2 * np.pi / 65536, 1e-12, 1e3, "one step, at the motor"),
    )
    test_values = (
        TestValue({"signal": 0.74, "resolution": 0.5}, {"signal": 0.5}, "below the threshold at 0.75"),
        TestValue({"signal": 0.76, "resolution": 0.5}, {"signal": 1.0}, "beyond it"),
        TestValue({"signal": -0.76, "resolution": 0.5}, {"signal": -1.0}, "beyond the threshold at -0.75"),
    )

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """On the position by statistical linearisation; on the torque 1, for it moves over many steps."""
        if place.side != "position" or not (np.any(motion.position_rms) or np.any(motion.sine_speed)):
            return np.ones(np.shape(omega), dtype=np.complex128)
        slow = np.asarray(motion.sine_omega, dtype=float)
        speed = np.asarray(motion.sine_speed, dtype=float)
        amplitude = np.where(
            slow > 0, speed / np.where(slow > 0, slow, 1.0), np.where(speed != 0, np.inf, 0.0)
        )
        amplitude = np.minimum(
            amplitude, 1e6 * parameters[0]
        )  # more: J0 is nothing, and needs a finite number
        gain = quantiser_gain(parameters[0], motion.position_bias, motion.position_rms, amplitude)
        return np.asarray(gain[..., None] * np.ones(np.shape(omega)), dtype=np.complex128)
