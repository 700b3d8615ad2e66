"""LuGre friction: bristles with damping, whose level of slip follows the Stribeck curve.

Theory (Canudas de Wit, Olsson, Astroem and Lischinsky 1995): the mean deflection b of the bristles obeys
``b' = v - sigma0 |v| b / g(v)`` with ``g(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2)``; the torque is
``F = sigma0 b + sigma1 b' + sigma2 v``. Steady sliding gives the Stribeck curve g(v) sign(v) + sigma2 v; small motions
meet the spring sigma0 and the damper sigma1 + sigma2; the break-away torque falls when the torque is raised faster;
a change of speed is followed with a lag. State: the bristles' torque z = sigma0 b, whose step is exact at constant
velocity. Limits: the memory is the present torque (loops inside loops drift, as Dahl's), and the damper sigma1 can
give energy back while g falls: the law takes energy from every motion where
``sigma2 > sigma1 (F_s - F_c) / F_c`` (Barahanov and Ortega 2000); without sigma1 always.
"""

from __future__ import annotations

from robid_core import ConfigurationError, FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, where
from robid_effects.bristle import advance_bristle
from robid_effects.stribeck import stribeck_level


@kernel
def lugre_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque in the middle of the step and its slopes; state: torque of the bristles."""
    stiffness, damping, viscous = parameters[3], parameters[4], parameters[5]
    level, level_slope = stribeck_level(velocity, parameters[0], parameters[1], parameters[2])
    rate, rate_slope = stiffness / level, -level_slope / level
    torque, slope = advance_bristle(state[0], velocity, stiffness, rate, rate_slope, 0.5 * step)
    next_state[0] = advance_bristle(state[0], velocity, stiffness, rate, rate_slope, step)[0]
    # b' = v (1 - sign(v) z / g): a damper that the share z / g takes away
    share = torque / level
    share_slope = (slope - share * level_slope) / level
    sign = where(velocity > 0.0, 1.0, where(velocity < 0.0, -1.0, 0.0))
    damper = viscous + damping * (1.0 - sign * share)
    damper_slope = -damping * sign * share_slope
    return torque + velocity * damper, 0.0, slope + damper + velocity * damper_slope


class LuGre(ForceEffect):
    """LuGre friction: spring and damper of the bristles, Stribeck curve, viscous torque."""

    source = (
        "C. Canudas de Wit, H. Olsson, K. J. Astroem, P. Lischinsky, A new model for control of systems with friction, "
        "IEEE Transactions on Automatic Control 40(3), 1995"
    )
    sides = ("motor", "gear", "arm", "bearing")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of fast sliding, F_c"),
        Parameter(
            "breakaway", "N m", 0.75, 0.0, 1e5, "level of slow sliding, F_s, not below the Coulomb level"
        ),
        Parameter("stribeck_speed", "rad/s", 1.0, 1e-6, 1e4, "speed at which the level falls, v_s"),
        Parameter("stiffness", "N m/rad", 100.0, 1e-6, 1e9, "of the bristles, sigma0"),
        Parameter("damping", "N m s/rad", 0.01, 0.0, 1e5, "of the bristles, sigma1"),
        Parameter("viscous", "N m s/rad", 0.01, 0.0, 1e4, "torque per speed, sigma2"),
    )
    n_state = 1
    law = staticmethod(lugre_law)
    test_values = (
        TestValue(
            {"velocity": 2.0, "step": 10.0, "coulomb": 1.0, "breakaway": 3.0, "stribeck_speed": 2.0},
            {"force": 1.0 + 2.0 / 2.718281828459045 + 0.02, "next_state": (1.0 + 2.0 / 2.718281828459045,)},
            "steady sliding at the Stribeck speed: F_c + (F_s - F_c) / e + sigma2 v",
        ),
        TestValue(
            {"step": 0.02, "stiffness": 50.0, "damping": 0.3, "viscous": 0.2},
            {"force": 0.0, "slope_velocity": 50.0 * 0.01 + 0.3 + 0.2, "next_state": (0.0,)},
            "at rest: a spring sigma0 over half a step, and the dampers sigma1 + sigma2",
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
