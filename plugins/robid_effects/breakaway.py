"""Break-away: an axis at rest holds more than it does in motion, and lets go at once.

Theory (thesis section 2.5; A. Morin, 1833; H. Olsson et al., Friction models and friction compensation,
European Journal of Control 4, 1998, section 2): up to a level F_s the contact sticks; beyond it, it slides at
the Coulomb level F_c < F_s, whatever the speed, until the motion reverses or stops. Sticking contact is a
stiff spring k with a damper, as in the bristles of Haessig and Friedland (On the modeling and simulation of
friction, ASME Journal of Dynamic Systems, Measurement, and Control 113, 1991), so that an axis at rest really
rests. The spring is bounded by F_s while it sticks and falls to F_c when it lets go; on reversal it starts
from there, so that the torque is continuous. State: the spring's torque, and whether the contact slides. The
law is passive: the torque never gives back more than the spring has stored, z^2 / (2 k).

Unlike Stribeck friction there is no negative slope in steady sliding: what shows the
difference is the first moment of each reversal.
"""

from __future__ import annotations

from robid_core import ConfigurationError, FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, where


@kernel
def breakaway_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque in the middle of the step and its slopes; state: torque of the contact, 1 while it slides."""
    coulomb, breakaway, stiffness, damping = parameters[0], parameters[1], parameters[2], parameters[3]
    sliding = (state[1] > 0.5) & (state[0] * velocity > 0.0)
    middle = state[0] + 0.5 * step * stiffness * velocity
    end = state[0] + step * stiffness * velocity
    level = where(velocity > 0.0, coulomb, -coulomb)
    slides_middle = sliding | (abs(middle) > breakaway)
    slides_end = sliding | (abs(end) > breakaway)
    next_state[0] = where(slides_end, level, end)
    next_state[1] = where(step > 0.0, where(slides_end, 1.0, 0.0), state[1])
    force = where(slides_middle, level, middle + damping * velocity)
    return force, 0.0 * position, where(slides_middle, 0.0, 0.5 * step * stiffness + damping)


class Breakaway(ForceEffect):
    """Coulomb friction with a higher breakaway level at rest."""

    source = (
        "H. Olsson, K. J. Astroem, C. Canudas de Wit, M. Gaefvert, P. Lischinsky, Friction models and friction "
        "compensation, European Journal of Control 4, 1998; D. A. Haessig, B. Friedland, 1991"
    )
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of sliding, F_c"),
        Parameter(
            "breakaway", "N m", 0.8, 0.0, 1e5, "level at which the contact lets go, F_s, not below F_c"
        ),
        Parameter("stiffness", "N m/rad", 200.0, 1e-3, 1e9, "of the contact while it sticks, k"),
        Parameter("damping", "N m s/rad", 0.3, 0.0, 1e6, "of the contact while it sticks"),
    )
    n_state = 2
    law = staticmethod(breakaway_law)
    test_values = (
        TestValue(
            {"velocity": 0.1, "step": 0.01, "state": (0.3, 0.0), "stiffness": 200.0, "damping": 0.5},
            {"force": 0.3 + 0.1 + 0.05, "slope_velocity": 1.0 + 0.5, "next_state": (0.5, 0.0)},
            "by hand: a spring of 200 N m/rad turned by 1 mrad, and its damper",
        ),
        TestValue(
            {"velocity": 1.0, "step": 0.01, "state": (0.3, 0.0), "coulomb": 0.5, "breakaway": 0.8},
            {"force": 0.5, "slope_velocity": 0.0, "next_state": (0.5, 1.0)},
            "by hand: 0.3 N m + 200 N m/rad * 5 mrad is above the break-away level",
        ),
        TestValue(
            {"velocity": -0.1, "step": 0.01, "state": (0.5, 1.0), "damping": 0.0},
            {"force": 0.4, "slope_velocity": 1.0, "next_state": (0.3, 0.0)},
            "by hand: on reversal the contact sticks at once",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Return the table's values; a break-away level below the Coulomb level is refused."""
        if parameters[1] < parameters[0]:
            raise ConfigurationError(
                f"effect {place.label}: breakaway is {parameters[1]:g} N m, below coulomb {parameters[0]:g} N m; "
                "give a level at rest that is at least the level of sliding."
            )
        return super().arguments(parameters, place)
