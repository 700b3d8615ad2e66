"""A corner in the torque over the deflection of a spring: rounded, and what a motion makes of it.

Catalogue curves, soft zones and backlash are sums of ramps. A ramp is rounded by a parabola within a stated
radius, exact outside of it, so that its slope rises linearly; the mean of that slope is then closed: for a
Gaussian deflection by the integral of the normal distribution (Booton 1954; Roberts and Spanos, Random Vibration
and Statistical Linearization, 1990, section 5), for a sine by that of the arcsine (Gelb and Vander Velde 1968,
describing function of the dead zone).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from robid_core import Motion
from robid_core.mechanics import kernel

FloatArray = npt.NDArray[np.float64]

SMALLEST_RADIUS = 1e-12
"""rad; a corner is never sharper."""
N_PHASE = 400
"""Phases of the slow sine over which the Gaussian mean is averaged (midpoint rule)."""


@kernel
def rounded_ramp(x, radius):  # type: ignore[no-untyped-def]
    """(max(x, 0) with its corner rounded within +-radius, its slope); at the corner radius / 4 above."""
    inside = min(max(x + radius, 0.0), 2.0 * radius)
    slope = inside / (2.0 * radius)
    return 0.5 * inside * slope + max(x - radius, 0.0), slope


def slow_amplitude(motion: Motion) -> FloatArray:
    """Amplitude of the slow sine's deflection, speed / omega; 0 where its frequency is not known (omega = 0)."""
    speed, omega = np.broadcast_arrays(
        np.asarray(motion.sine_speed, dtype=float), np.asarray(motion.sine_omega, dtype=float)
    )
    amplitude: FloatArray = np.divide(speed, omega, out=np.zeros(speed.shape), where=omega > 0)
    return amplitude


def mean_slope_outside(corner: float, radius: float, motion: Motion) -> FloatArray:
    """Mean slope of the ramps beyond +-corner: 0 for a motion within them, 1 for one that is hardly ever.

    With the deflection b + A sin(phase) + s g, g normal, and Q(d) = d Phi(d / s) + s phi(d / s), the ramp beyond c
    has the mean slope (Q(m - c + r) - Q(m - c - r)) / (2 r) about m = b + A sin(phase). Sharp corners, no sine:
    1 - Phi((c - b) / s) + Phi((-c - b) / s). The mean over the phase is taken at N_PHASE points: error below 2e-4
    where s or r is above A / 100.

    Returns
    -------
    Shape of the motion's fields, broadcast.
    """
    bias, rms, amplitude = (
        np.asarray(value, dtype=float)[..., None]
        for value in (motion.position_bias, motion.position_rms, slow_amplitude(motion))
    )
    n_phase = N_PHASE if amplitude.any() else 1
    mean = bias + amplitude * np.sin(np.pi * ((np.arange(n_phase) + 0.5) / n_phase - 0.5))
    rms = np.maximum(rms, 1e-9 * radius)
    share = sum(
        _integrated_normal(sign * mean - corner + radius, rms)
        - _integrated_normal(sign * mean - corner - radius, rms)
        for sign in (1.0, -1.0)
    )
    slope: FloatArray = np.mean(share, axis=-1) / (2 * radius)
    return slope


def describing_function_outside(amplitude: npt.ArrayLike, corner: float, radius: float) -> FloatArray:
    """First harmonic over amplitude A of the ramps beyond +-corner, for a deflection A sin(phase).

    1 - (2 / pi) (asin mu + mu sqrt(1 - mu^2)), mu = min(c / A, 1), for sharp corners (Gelb and Vander Velde 1968);
    rounded ones are its mean over corners from c - r to c + r.
    """
    a = np.asarray(amplitude, dtype=float)
    inside = _integrated_dead_zone((corner + radius) / a) - _integrated_dead_zone((corner - radius) / a)
    gain: FloatArray = np.asarray(1 - 2 / np.pi * a / (2 * radius) * inside)
    return gain


def _integrated_normal(d: FloatArray, rms: FloatArray) -> FloatArray:
    u = d / rms
    integral: FloatArray = d * ndtr(u) + rms / np.sqrt(2 * np.pi) * np.exp(-0.5 * u * u)
    return integral


def _integrated_dead_zone(mu: FloatArray) -> FloatArray:
    """Integral of asin mu + mu sqrt(1 - mu^2), which stays at pi / 2 beyond 1."""
    m = np.minimum(mu, 1.0)
    root = np.sqrt(1 - m * m)
    integral: FloatArray = m * np.arcsin(m) + root - root**3 / 3 + np.pi / 2 * (mu - m)
    return integral
