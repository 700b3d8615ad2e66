"""Direction of a motion, which Coulomb friction multiplies: sharp, or smooth within a speed at which friction turns."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray


def direction(velocity: FloatArray, speed: FloatArray) -> FloatArray:
    """Return what Coulomb friction multiplies, tanh(v / v_s), or sign(v) where v_s is zero, (n_sample, n_axis).

    Parameters
    ----------
    velocity
        Of the motors, (n_sample, n_axis).
    speed
        v_s, (n_axis,).
    """
    steep = np.where(speed > 0, speed, 1.0)
    result: FloatArray = np.where(speed > 0, np.tanh(velocity / steep), np.sign(velocity))
    return result


def direction_slope(velocity: FloatArray, speed: FloatArray) -> FloatArray:
    """Derivative of `direction` by v_s, same arguments and shape; zero where v_s is."""
    steep = np.where(speed > 0, speed, 1.0)
    ratio = velocity / steep
    slope = -ratio / steep / np.cosh(np.clip(ratio, -50.0, 50.0)) ** 2
    result: FloatArray = np.where(speed > 0, slope, 0.0)
    return result
