"""Stribeck friction: the level falls from a break-away to a Coulomb torque as the lubricant takes over.

Theory (R. Stribeck, 1902; L. C. Bo, D. Pavelescu, The friction-speed relation and its influence on the
critical velocity of stick-slip motion, Wear 82, 1982): ``F = (F_c + (F_s - F_c) exp(-|v / v_S|^n)) sign(v) +
d v``. The exponent n is 1 with Tustin (1947), 2 with Armstrong-Helouvry (1991), 1.3 for a robot's joint with
Bittencourt and Gunnarsson (2012). The sign is tanh(v / v_0) with v_0 well below v_S. Where the slope is
negative a slow axis sticks and slips. In Gaussian motion the excess alone has, at n = 2 and with a sharp
sign, the gain ``sqrt(2 / pi) (F_s - F_c) / rms / (1 + 2 rms^2 / v_S^2)``: it fades as 1 / rms^3 where
Coulomb's fades as 1 / rms, which distinguishes the two.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import ConfigurationError, FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import exponential, kernel, natural_logarithm, smooth_sign
from robid_effects.bristle import SMALLEST_LEVEL


@kernel
def stribeck_decay(velocity, speed, exponent):  # type: ignore[no-untyped-def]
    """exp(-|velocity / speed|^exponent) and its slope in velocity."""
    power = exponential(exponent * natural_logarithm(abs(velocity) / speed))
    decay = exponential(-power)
    return decay, -exponent * power * decay * velocity / max(velocity * velocity, 1e-36 * speed * speed)


@kernel
def stribeck_level(velocity, coulomb, breakaway, stribeck_speed):  # type: ignore[no-untyped-def]
    """Level of sliding for n = 2 (N m), smooth at rest, and its slope in velocity; the bristles' laws slip at it."""
    ratio = velocity / stribeck_speed
    excess = (breakaway - coulomb) * exponential(-ratio * ratio)
    return max(coulomb + excess, SMALLEST_LEVEL), -2.0 * excess * ratio / stribeck_speed


@kernel
def stribeck_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: coulomb, breakaway, stribeck_speed, exponent, viscous, speed."""
    excess = parameters[1] - parameters[0]
    decay, in_decay = stribeck_decay(velocity, parameters[2], parameters[3])
    share = smooth_sign(velocity / parameters[5])
    level = parameters[0] + excess * decay
    slope = level / parameters[5] * (1.0 - share * share) + excess * in_decay * share + parameters[4]
    return level * share + parameters[4] * velocity, 0.0 * position, slope


class Stribeck(ForceEffect):
    """Coulomb and viscous friction with a higher level at low speed."""

    source = (
        "L. C. Bo, D. Pavelescu, Wear 82, 1982; B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, A survey of "
        "models, analysis tools and compensation methods for the control of machines with friction, Automatica "
        "30(7), 1994"
    )
    sides = ("motor", "gear", "arm")
    searched_at = ("arm",)
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of fast sliding, F_c"),
        Parameter("breakaway", "N m", 0.8, 0.0, 1e5, "level of slow sliding, F_s, not below F_c"),
        Parameter("stribeck_speed", "rad/s", 5.0, 1e-6, 1e4, "speed at which the level falls, v_S"),
        Parameter("exponent", "1", 2.0, 0.5, 4.0, "how abruptly it falls, n"),
        Parameter("viscous", "N m s/rad", 0.0, 0.0, 1e5, "torque per speed, d"),
        Parameter("speed", "rad/s", 0.2, 1e-6, 1e3, "smoothing speed of the sign, v_0"),
    )
    law = staticmethod(stribeck_law)
    test_values = (
        TestValue(
            {"velocity": -5.0, "coulomb": 1.0, "breakaway": 3.0, "viscous": 0.1, "exponent": 1.3},
            {"force": -(1.0 + 2.0 / math.e) - 0.5, "slope_velocity": 0.1 - 1.3 * 2.0 / math.e / 5.0},
            "by hand: at the Stribeck speed 1/e of the excess is left, for any exponent",
        ),
        TestValue(
            {"velocity": 10.0, "coulomb": 1.0, "breakaway": 3.0, "exponent": 2.0},
            {"force": 1.0 + 2.0 * math.exp(-4.0), "slope_velocity": -2.0 * 2.0 * 2.0 / 5.0 * math.exp(-4.0)},
            "by hand: at twice that speed, exp(-4) of it",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Return the table's values; a break-away torque below the Coulomb level is refused."""
        if parameters[1] < parameters[0]:
            raise ConfigurationError(
                f"effect {place.label}: breakaway is {parameters[1]:g} N m, below coulomb {parameters[0]:g} N m; "
                "give a level of slow sliding that is at least the Coulomb level."
            )
        return super().arguments(parameters, place)

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Force per unit of both levels and of the viscous coefficient, at the given speeds and exponent."""
        decay = np.exp(-(np.abs(velocity / parameters[2]) ** parameters[3]))
        share = np.tanh(velocity / parameters[5])
        return {"coulomb": (1 - decay) * share, "breakaway": decay * share, "viscous": velocity}
