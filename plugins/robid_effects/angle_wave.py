"""A sine of the motor angle, order times a turn: the common part of torque ripple, cogging and resolver ripple.

Two things are asked of it: its mean over a step of the simulation, and its mean under a motion. The first is the
value in the middle times sin(x)/x with x half the phase that passes in the step; the second follows from the
characteristic functions of a Gaussian and of a sine (arcsine distribution).
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core import ComplexArray, Motion
from robid_core.mechanics import kernel

TURN = np.pi * np.pi  # square of half a period


@kernel
def cardinal_sine(x):  # type: ignore[no-untyped-def]
    """sin(x) / x where abs(x) < pi, error below 3e-7 (1e-14 where abs(x) < 1); zero beyond.

    Beyond, a whole period or more passes in the step: such a step cannot show the wave. Taylor polynomial.
    """
    z = min(x * x, TURN)
    p = 1.0 / 6227020800.0 - z / 1307674368000.0
    p = 1.0 / 362880.0 - z * (1.0 / 39916800.0 - z * p)
    return 1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0 - z * p)))


def mean_wave(order: float, phase: float, motion: Motion) -> ComplexArray:
    """Mean of exp(i (order angle + phase)) under a motion, shape of the motion's fields.

    exp(i (n mean + phase)) exp(-n^2 rms^2 / 2) J0(n amplitude): Gaussian, and slow sine of amplitude
    sine_speed / sine_omega about the mean. A sine of unknown frequency is taken to pass many periods of
    the wave: mean 0.
    """
    speed, omega = np.broadcast_arrays(
        np.asarray(motion.sine_speed, dtype=float), np.asarray(motion.sine_omega, dtype=float)
    )
    amplitude = np.divide(speed, omega, out=np.zeros(speed.shape), where=omega > 0)
    slow = np.where((speed != 0) & (omega <= 0), 0.0, scipy.special.j0(order * amplitude))
    gaussian = np.exp(-0.5 * np.square(order * np.asarray(motion.position_rms, dtype=float)))
    angle = order * np.asarray(motion.position_bias, dtype=float) + phase
    wave: ComplexArray = np.asarray(np.exp(1j * angle) * gaussian * slow, dtype=np.complex128)
    return wave
