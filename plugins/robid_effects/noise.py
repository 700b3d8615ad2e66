"""Noise of a measurement: white, or coloured by a correlation time.

Theory: white noise is a new Gaussian number at every sample. Coloured noise is the first-order autoregression
x[k+1] = r x[k] + sqrt(1 - r^2) rms w[k], r = exp(-sample time / correlation time), started in its stationary
state: the sampled Ornstein-Uhlenbeck process, with autocorrelation rms^2 r^|k| and spectrum rms^2 (1 - r^2) / |1 -
r exp(-i w T)|^2 (Brockwell and Davis 1991). It is drawn before the run and added to the channel; on the position
the controller sees it.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel

RMS = Parameter("rms", "rad or N m", 1e-4, 0.0, 1e3, "standard deviation of a sample, in the channel's unit")


def autoregression(white: FloatArray, pole: float) -> FloatArray:
    """Unit white noise to unit noise of autocorrelation pole^|k| along the last axis, stationary from the start."""
    driven = np.sqrt(1 - pole * pole) * white
    driven[..., 0] = white[..., 0]
    coloured: FloatArray = scipy.signal.lfilter([1.0], [1.0, -pole], driven, axis=-1)
    return coloured


@kernel
def noise_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """The signal itself; noise is drawn beforehand."""
    return signal


class WhiteNoise(SignalEffect):
    """Independent Gaussian noise at every sample."""

    source = "Definition"
    channels = ("position", "torque_measurement")
    law = staticmethod(noise_law)
    parameters = (RMS,)
    test_values = (TestValue({"signal": 0.7}, {"signal": 0.7}, "noise is added elsewhere"),)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1."""
        return np.ones(np.shape(omega), dtype=np.complex128)

    @classmethod
    def draw(
        cls, parameters: FloatArray, place: Place, shape: tuple[int, int], generator: np.random.Generator
    ) -> FloatArray | None:
        """White noise, shape (n_lane, n_sample)."""
        return float(parameters[0]) * generator.standard_normal(shape)


class ColouredNoise(SignalEffect):
    """Gaussian noise whose autocorrelation falls exponentially."""

    source = "Brockwell and Davis 1991, Time Series: Theory and Methods, section 3.1"
    channels = ("position", "torque_measurement")
    law = staticmethod(noise_law)
    parameters = (
        RMS,
        Parameter("correlation_time", "s", 0.01, 0.0, 1e4, "after which correlation is 1/e; 0: white"),
    )
    test_values = (TestValue({"signal": 0.7}, {"signal": 0.7}, "noise is added elsewhere"),)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1."""
        return np.ones(np.shape(omega), dtype=np.complex128)

    @classmethod
    def draw(
        cls, parameters: FloatArray, place: Place, shape: tuple[int, int], generator: np.random.Generator
    ) -> FloatArray | None:
        """Coloured noise, shape (n_lane, n_sample)."""
        rms, correlation_time = parameters
        pole = float(np.exp(-place.sample_time / correlation_time)) if correlation_time > 0 else 0.0
        return float(rms) * autoregression(generator.standard_normal(shape), pole)
