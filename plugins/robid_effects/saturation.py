"""Saturation of the drive: torque is held below a limit, and changes no faster than a rate.

Theory: the command is cut at +-limit; the acting torque goes to it at +-rate and stays there. Both are exact
within a step: a ramp that arrives contributes its triangle to the mean. For a Gaussian torque of mean m and rms s
the limit L has the equivalent gain (erf((L - m) / (s sqrt 2)) + erf((L + m) / (s sqrt 2))) / 2, the share of time
inside (Booton 1954). A rate limit has memory: a sine lags behind on a ramp and falls to a triangle, of gain 4 /
(pi a) and phase -arccos(pi / (2 a)) where its slope is a > 1.86 times the rate (Gelb and Vander Velde 1968). A
narrow-band Gaussian is a sine of Rayleigh distributed amplitude; in a broad band slow lines lose less than is
stated here, which takes each line for the carrier of the whole rms. State: started, torque.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel, where

TINY = 1e-300
FULL = np.sqrt(1 + np.pi**2 / 4)  # slope of a sine over the rate, from which on its response is a triangle


@kernel
def saturation_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Mean torque over the step; parameters: limit, rate."""
    target = max(min(signal, parameters[0]), -parameters[0])
    start = where(state[0] > 0.5, state[1], target)
    reach = parameters[1] * step
    way = target - start
    change = min(abs(way), reach)
    direction = where(way < 0.0, -1.0, 1.0)
    next_state[0] = 1.0
    next_state[1] = where(abs(way) <= reach, target, start + direction * change)
    return next_state[1] - direction * (0.5 * change * change / max(reach, TINY))


def limit_gain(limit: float, mean: npt.ArrayLike, rms: npt.ArrayLike) -> FloatArray:
    """Equivalent gain of a symmetric limit under a Gaussian signal: the share of time inside it."""
    spread = np.sqrt(2) * np.maximum(np.asarray(rms, dtype=float), TINY**0.5)
    mean = np.asarray(mean, dtype=float)
    gain: FloatArray = 0.5 * (
        scipy.special.erf((limit - mean) / spread) + scipy.special.erf((limit + mean) / spread)
    )
    return gain


def rate_limited_sine(slope: FloatArray) -> ComplexArray:
    """Describing function of a rate limit for a sine whose steepest slope is `slope` times the rate.

    1 up to slope 1. From angle -arccos(1 / slope) on the output is a ramp until it reaches the sine again (found by
    bisection); from slope sqrt(1 + pi^2 / 4) on it is a triangle that never does. What the ramp leaves out of the
    sine is integrated over half a period (Gauss-Legendre).
    """
    a = np.maximum(np.asarray(slope, dtype=float), 1.0)
    leave = -np.arccos(1 / np.minimum(a, FULL))
    low, high = -leave, np.pi + leave
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = np.sin(middle) > np.sin(leave) + (middle - leave) / a
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle = leave[..., None] + (low - leave)[..., None] * 0.5 * (1 + nodes)
    ramp = np.sin(leave)[..., None] + (angle - leave[..., None]) / a[..., None]
    missing = ((np.sin(angle) - ramp) * 1j * np.exp(-1j * angle)) @ weights * 0.5 * (low - leave)
    triangle = 4 / (np.pi * a) * np.exp(-1j * np.arccos(np.minimum(np.pi / (2 * a), 1.0)))
    gain: ComplexArray = np.where(a < FULL, 1 - 2 / np.pi * missing, triangle)
    return gain


def rate_gain(rate: float, rms: npt.ArrayLike, omega: npt.ArrayLike) -> ComplexArray:
    """Equivalent gain of a rate limit at omega for a narrow-band Gaussian signal there; arguments broadcast.

    Mean of the describing function over the amplitude's square, x = amplitude^2 / (2 rms^2) being exponentially
    distributed (Gauss-Laguerre, right to 3e-4: the function has corners).
    """
    x, weights = np.polynomial.laguerre.laggauss(60)
    steepest = np.sqrt(2.0) * np.asarray(rms, dtype=float) * np.asarray(omega, dtype=float) / rate
    gain: ComplexArray = rate_limited_sine(steepest[..., None] * np.sqrt(x)) @ (weights * x)
    return gain


class Saturation(SignalEffect):
    """Saturation: limits of the torque and of its rate of change."""

    source = "Booton 1954; Gelb and Vander Velde 1968, Multiple-Input Describing Functions"
    channels = ("torque",)
    invertible = False
    law = staticmethod(saturation_law)
    n_state = 2
    parameters = (
        Parameter("limit", "N m", 20.0, 1e-6, 1e6, "largest torque of either sign"),
        Parameter("rate", "N m/s", 1e6, 1e-3, 1e9, "fastest change of the torque"),
    )
    test_values = (
        TestValue(
            {"signal": 9.0, "step": 1e-3, "limit": 5.0, "rate": 1e3, "state": (1.0, 4.5)},
            {"signal": 4.875, "next_state": (1.0, 5.0)},
            "ramp from 4.5 to 5 over half the step: (4.75 + 5) / 2",
        ),
        TestValue(
            {"signal": -9.0, "step": 1e-3, "limit": 5.0, "rate": 1e3, "state": (1.0, 4.5)},
            {"signal": 4.0, "next_state": (1.0, 3.5)},
            "ramp that does not arrive: its middle",
        ),
    )

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """Gain of the limit times that of the rate, for a torque of mean `load` and Gaussian rms `signal_rms`.

        What the limit lets through goes into the rate limit with the rms of its linear part.
        """
        limit, rate = parameters
        rms = np.asarray(getattr(motion, "signal_rms", 0.0), dtype=float)
        inside = limit_gain(limit, motion.load, rms)
        return inside[..., None] * rate_gain(rate, (inside * rms)[..., None], np.asarray(omega, dtype=float))
