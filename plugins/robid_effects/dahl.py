"""Dahl's friction: Coulomb friction with a spring in front of it.

Theory: solid friction is a stress-strain curve, ``dF/dx = sigma (1 - F sign(v) / F_c)`` (Dahl 1968, exponent 1). Small
motions meet the spring sigma; after a path of a few F_c / sigma the torque is F_c sign(v). Torque against path does
not depend on speed: no lag, no Stribeck curve. The memory is the present torque only, so that a small loop inside a
large one drifts (it does not close at once, as Masing's rule asks). No closed motion gains energy: the stored
energy F^2 / (2 sigma) loses |v| F^2 / F_c.
"""

from __future__ import annotations

from robid_core import ForceEffect, Parameter, TestValue
from robid_core.mechanics import kernel
from robid_effects.bristle import SMALLEST_LEVEL, advance_bristle


@kernel
def dahl_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque of the bristle in the middle of the step, exact at constant velocity; state: the torque."""
    stiffness = parameters[1]
    rate = stiffness / max(parameters[0], SMALLEST_LEVEL)
    force, slope = advance_bristle(state[0], velocity, stiffness, rate, 0.0, 0.5 * step)
    next_state[0] = advance_bristle(state[0], velocity, stiffness, rate, 0.0, step)[0]
    return force, 0.0, slope


class Dahl(ForceEffect):
    """Dahl friction: presliding with stiffness sigma up to the Coulomb level."""

    source = "P. R. Dahl, A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1, 1968"
    sides = ("motor", "gear", "arm", "bearing")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of steady sliding"),
        Parameter("stiffness", "N m/rad", 100.0, 1e-6, 1e9, "of small motions, sigma"),
    )
    n_state = 1
    law = staticmethod(dahl_law)
    test_values = (
        TestValue(
            {"velocity": 10.0, "step": 2e-3, "coulomb": 2.0, "stiffness": 200.0 * 0.6931471805599453},
            {
                "force": 1.0,
                "next_state": (1.5,),
                "slope_position": 0.0,
                "slope_velocity": 0.06931471805599453,
            },
            "Dahl 1968: from rest F = F_c (1 - exp(-sigma x / F_c)), half of F_c after x = ln 2 F_c / sigma",
        ),
        TestValue(
            {"velocity": -300.0, "step": 1.0, "coulomb": 2.0, "stiffness": 1e6, "state": (2.0,)},
            {"force": -2.0, "next_state": (-2.0,)},
            "steady sliding: the Coulomb level against the motion",
        ),
    )
