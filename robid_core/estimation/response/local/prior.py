"""Denominators from the poles of a nominal model: only the numerators are left to find.

All entries of G have the same poles, those of the robot, so one polynomial serves them all: the product over
the poles that lie nearest to a line, scaled to one there. It takes those away from G, and what is left is
smooth: a polynomial, found by linear least squares of the *output* error, with as few unknowns as the local
polynomial method and no bias of a linearised equation. A pole that is off by a part of its half-power width
leaves a dipole, which the numerator takes up in part; so the orders of what is left in are those of the
numerator, and no more poles are taken than it has coefficients for.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray
from robid_core.errors import ConfigurationError
from robid_core.estimation.response.local.window import Windows


def pole_frequencies(eigenvalues: ComplexArray) -> ComplexArray:
    """Complex frequencies ``s / (2 pi i)`` in Hz of the oscillating poles s, one of each pair, in order.

    Their real parts are positive; the imaginary ones, too, are where the pole is damped.
    """
    frequency = eigenvalues / (2j * np.pi)
    frequency = frequency[frequency.real > 1e-9 * np.abs(frequency).max(initial=0.0)]
    result: ComplexArray = frequency[np.argsort(frequency.real)]
    return result


def denominators(poles_hz: ComplexArray, windows: Windows, order: int) -> ComplexArray:
    """Coefficients in the local variable of ``prod (f - p) / (f_k - p)`` over the poles next to each line.

    Parameters
    ----------
    poles_hz
        Complex frequencies, (n_pole,).
    windows
        Their lines and half widths.
    order
        Poles taken at most; those farther from the line than one and a half times the window's half width are left
        out, since they change little over it.

    Returns
    -------
    Shape (n_freq, order + 1), the first coefficient one.

    Raises
    ------
    ConfigurationError
        If there is no pole, or one without damping lies on a line.
    """
    if len(poles_hz) == 0:
        raise ConfigurationError(
            "prior_poles: the nominal model has no oscillating pole; leave prior_poles out"
        )
    n_freq = len(windows.frequency_hz)
    away = poles_hz[None, :] - windows.frequency_hz[:, None]
    nearest = np.argsort(np.abs(away), axis=1)[:, :order]
    result = np.zeros((n_freq, order + 1), dtype=np.complex128)
    result[:, 0] = 1.0
    for place in range(nearest.shape[1]):
        distance = np.take_along_axis(away, nearest[:, place : place + 1], axis=1)[:, 0]
        near = np.abs(distance.real) <= 1.5 * windows.half_width_hz
        if (np.abs(distance[near]) == 0).any():
            line = int(np.flatnonzero(near & (distance == 0))[0])
            raise ConfigurationError(
                "prior_poles: the nominal model has an undamped pole at "
                f"{windows.frequency_hz[line]:.4g} Hz, a line; give it damping"
            )
        # (f - p) / (f_k - p) = 1 - t h / (p - f_k)
        slope = np.where(near, -windows.half_width_hz / np.where(near, distance, 1.0), 0.0)
        result[:, 1:] += slope[:, None] * result[:, :-1].copy()
    return result
