"""Friction that changes with temperature, and makes its own: a cold robot turns harder than a warm one.

Theory: ``F = F_c(T) tanh(v / v_s) + d(T) v``; the viscous coefficient falls exponentially, ``d = d_hot +
d_cold exp(-(T - T_a) / T_d)``, the Coulomb level changes linearly, ``F_c + c (T - T_a)`` but not below zero
(A. C. Bittencourt, S. Gunnarsson, ASME Journal of Dynamic Systems, Measurement, and Control 134(5), 2012).
Nobody measures T in the gear: it is warmed by the friction's own power against a first-order loss, ``C T' = F
v - C (T - T_a) / tau`` (F. B. Carlson, A. Robertsson, R. Johansson, Modeling and identification of position
and temperature dependent friction phenomena without temperature sensing, IROS 2015). State: the rise above
the start.

The step of the temperature is implicit Euler about the present state: bounded for any step, relative error
step / (2 tau), 1e-7 in practice. A run of seconds beside a tau of half an hour sees the start temperature;
the drift shows between runs.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import Equivalent, FloatArray, ForceEffect, Motion, Parameter, Place, TestValue
from robid_core.mechanics import equivalent_damping, exponential, kernel, smooth_sign, where


@kernel
def friction_at(velocity, rise, parameters):  # type: ignore[no-untyped-def]
    """Torque at a temperature `rise` above the ambient, its slope in velocity and in temperature."""
    linear = parameters[0] + parameters[1] * rise
    level = max(linear, 0.0)
    cold = parameters[3] * exponential(-rise / parameters[4])
    share = smooth_sign(velocity / parameters[9])
    force = level * share + (parameters[2] + cold) * velocity
    slope = level / parameters[9] * (1.0 - share * share) + parameters[2] + cold
    return force, slope, where(linear > 0.0, parameters[1], 0.0) * share - cold / parameters[4] * velocity


@kernel
def temperature_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque in the middle of the step and its slopes; state: rise above the start temperature."""
    rise = parameters[5] - parameters[6] + state[0]
    force, slope, in_rise = friction_at(velocity, rise, parameters)
    rate = force * velocity / parameters[7] - rise / parameters[8]
    fall = max(1.0 / parameters[8] - in_rise * velocity / parameters[7], 0.0)  # - d rate / d rise
    next_state[0] = state[0] + step * rate / (1.0 + step * fall)
    half = 0.5 * step / (1.0 + 0.5 * step * fall)
    warming = half * (force + velocity * slope) / parameters[7]
    force, slope, in_rise = friction_at(velocity, rise + half * rate, parameters)
    return force, 0.0 * position, slope + in_rise * warming


class Temperature(ForceEffect):
    """Coulomb and viscous friction that changes as the gear warms up."""

    source = (
        "A. C. Bittencourt, S. Gunnarsson, ASME Journal of Dynamic Systems, Measurement, and Control 134(5), 2012; "
        "F. B. Carlson, A. Robertsson, R. Johansson, IROS 2015"
    )
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "Coulomb level at ambient temperature, F_c"),
        Parameter("coulomb_slope", "N m/K", -0.002, -1e3, 1e3, "its change with temperature, c"),
        Parameter("viscous_hot", "N m s/rad", 0.002, 0.0, 1e5, "torque per speed that stays when hot, d_hot"),
        Parameter(
            "viscous_cold", "N m s/rad", 0.004, 0.0, 1e5, "what comes on top at ambient temperature, d_cold"
        ),
        Parameter("decay", "K", 20.0, 1.0, 1e3, "warming that takes that to 1/e, T_d"),
        Parameter("start", "degC", 25.0, -50.0, 200.0, "temperature at the start"),
        Parameter("ambient", "degC", 25.0, -50.0, 200.0, "temperature around, T_a"),
        Parameter("capacity", "J/K", 3000.0, 1.0, 1e8, "heat capacity of what warms up, C"),
        Parameter("time_constant", "s", 1800.0, 1.0, 1e6, "of cooling, tau"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign, v_s"),
    )
    n_state = 1
    law = staticmethod(temperature_law)
    test_values = (
        TestValue(
            {"velocity": 100.0, "start": 45.0},
            {"force": 0.5 - 0.04 + 0.2 + 0.4 / math.e, "slope_velocity": 0.002 + 0.004 / math.e},
            "by hand: 20 K above the ambient the cold part is at 1/e and the Coulomb level 0.04 N m lower",
        ),
        TestValue(
            {"state": (-10.0,), "start": 45.0, "time_constant": 100.0, "step": 25.0},
            {"force": 0.0, "next_state": (-12.0,)},
            "by hand: at rest, 10 K above the ambient, implicit Euler over a quarter of the time constant: 10 K / 1.25",
        ),
    )

    @classmethod
    def linearize(cls, parameters: FloatArray, place: Place, motion: Motion) -> Equivalent:
        """E[dF/dv] at the start temperature, in closed form."""
        coulomb, coulomb_slope, hot, cold, decay, start, ambient, _, _, speed = parameters
        level = max(coulomb + coulomb_slope * (start - ambient), 0.0)
        viscous = hot + cold * math.exp(-(start - ambient) / decay)
        damping = equivalent_damping(motion.velocity_rms, motion.sine_speed, level, viscous, speed)
        return Equivalent(np.zeros_like(damping), damping)
