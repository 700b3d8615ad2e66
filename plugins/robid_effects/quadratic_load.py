"""Friction of small gears that grows faster than the load: Coulomb's level with the load and with its square.

Theory: the teeth of a small gear slide on what they press, and plastic teeth, shafts and bearings bend until more of
them rub: ``F = (F_c + a L + c L^2) (1 + s exp(-|v / v_S|^n)) sign(v) + d v`` with ``L = |T| - e T``. The linear part is
that of A. C. Bittencourt and S. Gunnarsson 2012 (`load_dependent`), the square that of M. Duclusaud, G. Passault, V.
Padois, O. Ly, Extended friction models for the physics simulation of servo actuators, 2024, who needed it for servos
of small robots; s is the share that comes on top at low speed (Stribeck). The sign of a torque says which flanks of the
teeth press, and they are not alike: e is how much less a positive load counts, and a negative one more. T is the torque
of the transmission on the effect's own side, at the motor that of the motor less what its rotor takes where the gear is
rigid: where ``a |T| + c T^2 > |T| - |gravity|`` a servo stands still however long it pushes. Beyond the loads that were
measured the square goes on.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, smooth_sign
from robid_effects.stribeck import stribeck_decay


@kernel
def quadratic_load_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters in the order of the table."""
    size = abs(load) - parameters[8] * load
    decay, in_decay = stribeck_decay(velocity, parameters[4], parameters[5])
    share = smooth_sign(velocity / parameters[7])
    sliding = parameters[0] + size * (parameters[1] + parameters[2] * size)
    level = sliding * (1.0 + parameters[3] * decay)
    slope = (
        level / parameters[7] * (1.0 - share * share)
        + sliding * parameters[3] * in_decay * share
        + parameters[6]
    )
    return level * share + parameters[6] * velocity, 0.0 * position, slope


class QuadraticLoad(ForceEffect):
    """Coulomb and viscous friction whose level grows with the load and its square, and is higher at low speed."""

    source = (
        "M. Duclusaud, G. Passault, V. Padois, O. Ly, Extended friction models for the physics simulation of servo "
        "actuators, 2024"
    )
    sides = ("motor", "gear", "arm")
    searched = False  # load-dependent friction is a special case
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level without load, F_c"),
        Parameter("load_coulomb", "1", 0.03, 0.0, 2.0, "level per load, a"),
        Parameter("load_square", "1/(N m)", 0.01, 0.0, 1e3, "level per square of the load, c"),
        Parameter("excess", "1", 0.2, 0.0, 10.0, "share that comes on top at low speed, s"),
        Parameter("stribeck_speed", "rad/s", 9.0, 1e-6, 1e4, "speed at which that falls, v_S"),
        Parameter("exponent", "1", 1.3, 0.5, 4.0, "how abruptly it falls, n"),
        Parameter("viscous", "N m s/rad", 0.0, 0.0, 1e5, "torque per speed, d"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign"),
        Parameter(
            "asymmetry", "1", 0.0, -0.9, 0.9, "share that a positive load counts less, a negative one more, e"
        ),
    )
    law = staticmethod(quadratic_load_law)
    test_values = (
        TestValue(
            {"velocity": 9.0, "load": -4.0, "viscous": 0.01},
            {
                "force": (0.5 + 0.12 + 0.16) * (1 + 0.2 / math.e) + 0.09,
                "slope_velocity": 0.01 - 1.3 * 0.78 * 0.2 / math.e / 9.0,
            },
            "by hand: at the Stribeck speed 1/e of the excess is left",
        ),
        TestValue(
            {"velocity": -500.0, "load": 4.0, "asymmetry": 0.25},
            {"force": -(0.5 + 0.09 + 0.09)},
            "by hand: the load counts for three quarters",
        ),
        TestValue({"velocity": -500.0, "load": 4.0}, {"force": -0.78}, "by hand: fast, no excess"),
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
        """Force per unit of the levels and of the viscous coefficient, at the given excess, speeds and exponent."""
        decay = np.exp(-(np.abs(velocity / parameters[4]) ** parameters[5]))
        share = np.tanh(velocity / parameters[7]) * (1 + parameters[3] * decay)
        size = np.abs(load) - parameters[8] * load
        return {
            "coulomb": share,
            "load_coulomb": size * share,
            "load_square": size**2 * share,
            "viscous": velocity,
        }
