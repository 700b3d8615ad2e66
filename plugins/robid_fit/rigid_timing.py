"""Timing in a rigid fit: torques moved by any part of a sample, and how what is predicted changes with it.

A recorded torque that lags by d is ``T(t) = tau(t - d)``; it is moved back by its Fourier series, exact for all that is
below the Nyquist frequency, so that no step of an interpolation favours some lags. An experiment does not repeat: its
series is that of its odd continuation at both ends, about the line through them.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray


def moved_back(values: FloatArray, delay: FloatArray) -> FloatArray:
    """Return samples as they were `delay` samples earlier, ``values(t + delay)``, same shape.

    Parameters
    ----------
    values
        Shape (n_sample, n_axis).
    delay
        In samples, (n_axis,).
    """
    if not delay.any():
        return values
    line, slope, spectrum, omega = _series(values)
    inside = np.fft.irfft(spectrum * np.exp(1j * omega * delay), 2 * (len(values) - 1), axis=0)
    result: FloatArray = inside[: len(values)] + line + slope * delay
    return result


def rate(values: FloatArray) -> FloatArray:
    """Return the derivative of `moved_back` by the delay, per sample, (n_sample, n_axis)."""
    _, slope, spectrum, omega = _series(values)
    result: FloatArray = np.fft.irfft(1j * omega * spectrum, 2 * (len(values) - 1), axis=0)[: len(values)]
    return result + slope


def _series(values: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray, FloatArray]:
    """Line through both ends and its slope, spectrum of what is left, continued oddly, and rad per sample of it."""
    n = len(values)
    slope = (values[-1] - values[0]) / (n - 1)
    line = values[0] + slope * np.arange(n)[:, None]
    left = values - line
    spectrum = np.fft.rfft(np.concatenate((left, -left[-2:0:-1])), axis=0)
    return line, slope, spectrum, np.pi * np.arange(n)[:, None] / (n - 1)
