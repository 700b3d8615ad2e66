"""Coulomb and viscous friction (2.10) with the smooth sign of (2.9), and its statistical linearisation.

The gain that a small signal sees is E[df/dv] under the speed distribution of everything else that moves the
motor (S. H. Crandall, Is stochastic equivalent linearization a subtly flawed procedure?, 2004, and references
there): multisine and noise make it Gaussian, the slow sine adds an arcsine part.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt
import scipy

from robid_core.arrays import FloatArray
from robid_core.compiled.functions import smooth_sign
from robid_core.compiled.kernel import kernel
from robid_core.errors import ConfigurationError
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.terms import ForceTerm

_MIXTURE_NODES = 96  # Gauss-Legendre; error below 1e-11 of the gain (tests: closed form at rest, quadrature)
_MIXTURE_LIMITS = (0.12, 6.0)  # the Kolmogorov distribution has less than 1e-30 outside


def friction_torque(
    speed: npt.ArrayLike, coulomb: npt.ArrayLike, viscous: npt.ArrayLike, friction_speed: npt.ArrayLike
) -> FloatArray:
    """Torque against the motion: coulomb tanh(speed / friction_speed) + viscous speed.

    Parameters
    ----------
    speed
        rad/s; the arguments broadcast.
    coulomb, viscous
        N m and N m s/rad.
    friction_speed
        Speed at which 76 % of the Coulomb torque act, rad/s, > 0.
    """
    v = np.asarray(speed, dtype=np.float64)
    torque: FloatArray = (
        np.asarray(coulomb) * np.tanh(v / np.asarray(friction_speed)) + np.asarray(viscous) * v
    )
    return torque


def equivalent_damping(
    gaussian_rms: npt.ArrayLike,
    sine_amplitude: npt.ArrayLike,
    coulomb: npt.ArrayLike,
    viscous: npt.ArrayLike,
    friction_speed: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Viscous gain E[df/dv] that replaces friction for a small signal on top of Gaussian and sine speed.

    For the sharp sign, df/dv is twice a pulse at zero speed: E = 2 coulomb p(0) + viscous. The density at zero of
    a Gaussian of rms s plus a sine of amplitude A is ``exp(-x) I0(x) / (s sqrt(2 pi))``, x = A^2 / (4 s^2):
    ``sqrt(2/pi) coulomb / s`` without the sine, ``2 coulomb / (pi A)`` without the Gaussian. The slope of the tanh
    is the density of a logistic variable of scale friction_speed / 2, which is a Gaussian of rms
    friction_speed K with K Kolmogorov distributed (D. F. Andrews and C. L. Mallows, Scale mixtures of normal
    distributions, 1974): one quadrature over K remains.

    The slow sine itself sees another, larger gain (describing function: twice this in the sharp limit).

    Parameters
    ----------
    gaussian_rms
        rms of the Gaussian part of the motor speed, rad/s, >= 0; the arguments broadcast.
    sine_amplitude
        Amplitude of the slow sine of the motor speed, rad/s, >= 0.
    coulomb, viscous
        N m and N m s/rad.
    friction_speed
        Smoothing speed of the sign, rad/s, >= 0; 0 is the sharp sign.

    Returns
    -------
    N m s/rad; infinite where nothing moves and the sign is sharp.
    """
    rms, amplitude, smoothing = np.broadcast_arrays(
        *(np.asarray(a, dtype=np.float64)[..., None] for a in (gaussian_rms, sine_amplitude, friction_speed))
    )
    factor, weight = _kolmogorov_mixture()
    spread = np.hypot(rms, smoothing * factor)
    # A vanishing spread is the arcsine limit of the formula; 1e-8 of the amplitude is there to 1e-16.
    spread = np.maximum(spread, 1e-8 * amplitude)
    with np.errstate(divide="ignore"):
        ratio = np.divide(amplitude, 2 * spread, out=np.zeros_like(spread), where=spread > 0)
        density = scipy.special.i0e(ratio**2) / (math.sqrt(2 * math.pi) * spread)
    at_zero = density @ weight
    fc = np.asarray(coulomb, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        return np.where(fc == 0, 0.0, 2 * fc * at_zero) + np.asarray(viscous, dtype=np.float64)


@cache
def _kolmogorov_mixture() -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of the Kolmogorov distribution, density 8 sum (-1)^(k+1) k^2 x exp(-2 k^2 x^2)."""
    low, high = _MIXTURE_LIMITS
    node, weight = np.polynomial.legendre.leggauss(_MIXTURE_NODES)
    x = low + (high - low) * (node + 1) / 2
    k = np.arange(1, 80)[:, None]
    # The series loses digits below x = 1; its theta-function twin there has one or two terms.
    tail = 8 * np.sum((-1.0) ** (k + 1) * k**2 * x * np.exp(-2 * k**2 * x**2), axis=0)
    u = (2 * k - 1) ** 2 * math.pi**2 / 8
    head = math.sqrt(2 * math.pi) * np.sum(np.exp(-u / x**2) * (2 * u / x**4 - 1 / x**2), axis=0)
    density = np.where(x < 1, head, tail)
    weight = weight * density
    return x, weight / weight.sum()


def friction_terms(
    mechanism: Mechanism,
    coulomb: FloatArray,
    viscous: FloatArray,
    friction_speed: FloatArray,
    offset: FloatArray | None = None,
) -> tuple[ForceTerm, ...]:
    """Coulomb, viscous and constant friction at the motor shafts, where there is any, as the simulator takes it.

    Parameters
    ----------
    mechanism
        The robot.
    coulomb, viscous, friction_speed, offset
        N m, N m s/rad, rad/s and N m, shape (n_axis,); below coulomb * step / rotor inertia a motor that comes to rest
        rattles at that friction_speed.

    Raises
    ------
    ConfigurationError
        Where a friction speed is not above zero.
    """
    unit, none = np.eye(mechanism.n_coordinate), np.zeros(mechanism.n_axis)
    rows = np.column_stack((coulomb, viscous, friction_speed, none if offset is None else offset))
    if not (rows[:, 2] > 0).all():
        raise ConfigurationError(f"friction speed {rows[:, 2].min():.6g} rad/s; give a speed above zero")
    return tuple(
        ForceTerm(coulomb_viscous_law, rows[a], unit[a], unit[a], none, 0, f"friction.{name}")
        for a, name in enumerate(mechanism.axis_names)
        if rows[a, [0, 1, 3]].any()
    )


@kernel
def coulomb_viscous_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Law of the friction in `friction_torque`; parameters: coulomb, viscous, friction_speed, constant offset."""
    smooth = smooth_sign(velocity / parameters[2])
    force = parameters[0] * smooth + parameters[1] * velocity + parameters[3]
    return force, 0.0 * velocity, parameters[0] / parameters[2] * (1.0 - smooth * smooth) + parameters[1]
