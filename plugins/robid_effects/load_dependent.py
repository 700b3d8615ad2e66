"""Friction that grows with the torque that the gear passes on.

Theory (A. C. Bittencourt, S. Gunnarsson, Static friction in a robot joint: modeling and identification of
load and temperature effects, ASME Journal of Dynamic Systems, Measurement, and Control 134(5), 2012): the
Coulomb level and the excess at low speed are linear in the size of the load, ``F = (F_c + a |T| + b |T|
exp(-|v / v_S|^n)) sign(v) + d v`` with n = 1.3; they found no effect of the load on the viscous part, and
there is none here. P. Hamon, M. Gautier, P. Garrec, Dynamic identification of robots with a dry friction
model depending on load and velocity, IROS 2010, have the same a |T|. T is the torque of the transmission on
the effect's own side (at the motor shaft on the motor side), gravity included: the factors have no unit, and
1 - a is an efficiency. What is linearised, and what the regressor sees, is a given load; where it changes
sign within the motion the mean of |T| is above |mean T|.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, smooth_sign
from robid_effects.stribeck import stribeck_decay


@kernel
def load_dependent_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters in the order of the table."""
    size = abs(load)
    decay, in_decay = stribeck_decay(velocity, parameters[3], parameters[4])
    share = smooth_sign(velocity / parameters[6])
    level = parameters[0] + size * (parameters[1] + parameters[2] * decay)
    slope = (
        level / parameters[6] * (1.0 - share * share)
        + size * parameters[2] * in_decay * share
        + parameters[5]
    )
    return level * share + parameters[5] * velocity, 0.0 * position, slope


class LoadDependent(ForceEffect):
    """Coulomb and viscous friction whose level grows with the load, more so at low speed."""

    source = "A. C. Bittencourt, S. Gunnarsson, ASME Journal of Dynamic Systems, Measurement, and Control 134(5), 2012"
    sides = ("motor", "gear", "arm")
    searched_at = ("arm",)
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level without load, F_c"),
        Parameter("load_coulomb", "1", 0.03, 0.0, 1.0, "Coulomb level per load, a"),
        Parameter("load_excess", "1", 0.1, 0.0, 1.0, "what comes on top at low speed, per load, b"),
        Parameter("stribeck_speed", "rad/s", 9.0, 1e-6, 1e4, "speed at which that falls, v_S"),
        Parameter("exponent", "1", 1.3, 0.5, 4.0, "how abruptly it falls, n"),
        Parameter("viscous", "N m s/rad", 0.0, 0.0, 1e5, "torque per speed, d"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign"),
    )
    law = staticmethod(load_dependent_law)
    test_values = (
        TestValue(
            {"velocity": 9.0, "load": -4.0, "viscous": 0.01},
            {"force": 0.5 + 0.12 + 0.4 / math.e + 0.09, "slope_velocity": 0.01 - 1.3 * 0.4 / math.e / 9.0},
            "by hand: at the Stribeck speed 1/e of the load's excess is left",
        ),
        TestValue({"velocity": -500.0, "load": 4.0}, {"force": -0.62}, "by hand: fast, Coulomb alone"),
    )

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Force per unit of the levels and coefficients, at the given speeds and exponent."""
        share = np.tanh(velocity / parameters[6])
        decay = np.exp(-(np.abs(velocity / parameters[3]) ** parameters[4]))
        return {
            "coulomb": share,
            "load_coulomb": np.abs(load) * share,
            "load_excess": np.abs(load) * decay * share,
            "viscous": velocity,
        }
