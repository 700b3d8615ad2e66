"""Two-state friction: presliding hysteresis, and a level of sliding that lags behind speed.

Not the two-state model of Ruderman and Bertram (2011, 2013), which gave it its name here, but a model of ours of the
same two phenomena: one state follows the path and holds the presliding hysteresis, one follows time and holds the
frictional lag; both end in the Stribeck curve S(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2). With that curve::

    z' = sigma v - sigma |v| z / w        torque of the asperities: presliding hysteresis
    w' = (S(v) - w) / lag                 level at which they flow: frictional lag
    F  = z + viscous v

From the last reversal r on, at steady w, the hysteresis branches as ``dz/dx = |W| K exp(-K |x - x_r|)`` with
K = sigma / w and W = w sign(v) - z_r: one exponential, whose steepness is what is left up to sliding. The slow state
is the level of the fast one and does not add to it: a lagging torque beside the spring would be a spring that
softens with frequency, a source of energy in small motions. As it is, the stored energy z^2 / (2 sigma) loses
|v| z^2 / w, whatever w does: no motion gains energy.

Small motions meet sigma at any frequency; steady sliding gives S(v) sign(v) + viscous v; a body at rest regains its
break-away torque within the lag, so break-away falls when force is raised faster or rest is shorter; sliding at
varying speed runs through a loop about the Stribeck curve. Limits: the memory is one reversal only (z itself), loops
inside loops drift and do not close at once as Masing's rule asks (`transmission.maxwell_slip` does); no range is purely
elastic, so that a small load creeps under vibration; the lag is one time at all speeds. Without lag it is LuGre without
sigma1, without Stribeck curve Dahl.
"""

from __future__ import annotations

from robid_core import ConfigurationError, FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import exponential, kernel
from robid_effects.bristle import SMALLEST_LEVEL, advance_bristle
from robid_effects.stribeck import stribeck_level


@kernel
def elasto_plastic_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque in the middle of the step and its slopes; state: torque of the asperities, drop of the level below F_s.

    The level is exact at constant velocity; the asperities move with the level in the middle of their interval
    (error of third order in a step, none in steady sliding).
    """
    breakaway, stiffness, viscous = parameters[1], parameters[3], parameters[5]
    sliding, sliding_slope = stribeck_level(velocity, parameters[0], breakaway, parameters[2])
    drop = breakaway - sliding
    quarter = exponential(-0.25 * step / parameters[4])
    half = quarter * quarter
    early = max(breakaway - drop - (state[1] - drop) * quarter, SMALLEST_LEVEL)
    middle = max(breakaway - drop - (state[1] - drop) * half, SMALLEST_LEVEL)
    rate_slope = sliding_slope * (quarter - 1.0) / early
    torque, slope = advance_bristle(state[0], velocity, stiffness, stiffness / early, rate_slope, 0.5 * step)
    next_state[0] = advance_bristle(state[0], velocity, stiffness, stiffness / middle, 0.0, step)[0]
    next_state[1] = drop + (state[1] - drop) * (half * half)
    return torque + viscous * velocity, 0.0, slope + viscous


class ElastoPlastic(ForceEffect):
    """Elasto-plastic friction with two states, of robid: presliding hysteresis and frictional lag, Stribeck curve."""

    source = (
        "this file: equations, and why they are passive; idea of two states after M. Ruderman, T. Bertram, Two-state "
        "dynamic friction model with elasto-plasticity, Mechanical Systems and Signal Processing 39(1-2), 2013"
    )
    sides = ("motor", "gear", "arm", "bearing")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of fast sliding, F_c"),
        Parameter(
            "breakaway", "N m", 0.75, 0.0, 1e5, "level of slow sliding, F_s, not below the Coulomb level"
        ),
        Parameter("stribeck_speed", "rad/s", 1.0, 1e-6, 1e4, "speed at which the level falls, v_s"),
        Parameter("stiffness", "N m/rad", 100.0, 1e-6, 1e9, "of small motions, sigma"),
        Parameter("lag", "s", 0.01, 1e-6, 1e3, "time in which the level follows the speed"),
        Parameter("viscous", "N m s/rad", 0.0, 0.0, 1e4, "torque per speed"),
    )
    n_state = 2
    law = staticmethod(elasto_plastic_law)
    test_values = (
        TestValue(
            {"velocity": -2.0, "step": 10.0, "coulomb": 1.0, "breakaway": 3.0, "stribeck_speed": 2.0},
            {
                "force": -1.0 - 2.0 / 2.718281828459045,
                "next_state": (-1.0 - 2.0 / 2.718281828459045, 2.0 - 2.0 / 2.718281828459045),
            },
            "steady sliding at the Stribeck speed: F_c + (F_s - F_c) / e",
        ),
        TestValue(
            {"velocity": 0.0, "step": 0.02, "stiffness": 50.0, "lag": 0.01, "state": (0.1, 0.2)},
            {"force": 0.1, "slope_velocity": 0.5, "next_state": (0.1, 0.2 / 2.718281828459045**2)},
            "at rest: a spring over half a step; the level recovers within the lag, the torque stays",
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
