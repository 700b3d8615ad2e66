"""Hysteresis of a gear or bearing as a smooth loop: the Bouc-Wen model.

Theory (Bouc 1967, Wen 1976; Ismail, Ikhouane and Rodellar 2009): the torque z of the hysteresis obeys
``z' = k v (1 - |z / T|^n ((1 - beta) + beta sign(v z)))``. From zero it starts with stiffness k and tends to +-T; n
says how sharp the knee is, beta what happens on the way back: 1/2 unloads along a straight line of slope k, 1 steeper.
This torque is *added* to the linear spring of the robot file: in Wen's letters that spring is alpha K and
k = (1 - alpha) K, A = 1, beta / (beta + gamma) = `share`. With 1/2 <= beta <= 1 no closed motion gains energy
(Ismail et al. 2009). With n = 1 and beta = 1 it is Dahl's. Independent of speed; the memory is the present torque, so
that small loops inside large ones drift. State: z.
"""

from __future__ import annotations

from robid_core import ForceEffect, Parameter, TestValue
from robid_core.mechanics import exponential, kernel, natural_logarithm, where
from robid_effects.bristle import SMALLEST_LEVEL, advance_bristle


@kernel
def rate_of_slip(torque, velocity, stiffness, ultimate, sharpness, share):  # type: ignore[no-untyped-def]
    """Rate (1/rad) with which ``z' = k v - rate |v| z`` is the law: k / T |z / T|^(n-1) (beta + (1-beta) sign(v z))."""
    way = where(velocity * torque < 0.0, 2.0 * share - 1.0, 1.0)
    power = exponential((sharpness - 1.0) * natural_logarithm(abs(torque) / ultimate))
    return stiffness / ultimate * power * way


@kernel
def bouc_wen_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque of the hysteresis in the middle of the step and its slopes; state: that torque.

    Exponential midpoint: exact with the rate of slip frozen, at the start for the first half, in the middle for the
    whole step; held within +-T, where the solution stays. Second order; exact for n = 1 away from z = 0.
    """
    stiffness, ultimate = parameters[0], max(parameters[1], SMALLEST_LEVEL)
    sharpness, share = parameters[2], parameters[3]
    rate = rate_of_slip(state[0], velocity, stiffness, ultimate, sharpness, share)
    free, slope = advance_bristle(state[0], velocity, stiffness, rate, 0.0, 0.5 * step)
    force = max(min(free, ultimate), -ultimate)
    rate = rate_of_slip(force, velocity, stiffness, ultimate, sharpness, share)
    free_end = advance_bristle(state[0], velocity, stiffness, rate, 0.0, step)[0]
    next_state[0] = max(min(free_end, ultimate), -ultimate)
    return force, 0.0, where(abs(free) < ultimate, slope, 0.0)


class BoucWen(ForceEffect):
    """Smooth hysteresis, added to the linear spring: initial stiffness, ultimate torque, sharpness of the knee."""

    source = (
        "M. Ismail, F. Ikhouane, J. Rodellar, The hysteresis Bouc-Wen model, a survey, "
        "Archives of Computational Methods in Engineering 16, 2009"
    )
    sides = ("gear", "bearing")
    parameters = (
        Parameter("stiffness", "N m/rad", 5e3, 1e-6, 1e10, "of the hysteresis at its start, k"),
        Parameter("torque", "N m", 5.0, 0.0, 1e6, "to which it tends, T"),
        Parameter("sharpness", "1", 1.5, 1.0, 20.0, "of the knee, n"),
        Parameter("share", "1", 0.5, 0.5, 1.0, "beta: 0.5 unloads along a straight line, 1 steeper"),
    )
    n_state = 1
    law = staticmethod(bouc_wen_law)
    test_values = (
        TestValue(
            {"velocity": 1.0, "step": 1.3862943611198906, "stiffness": 3.0, "torque": 3.0, "sharpness": 1.0},
            {"force": 1.5, "next_state": (2.25,)},
            "n = 1, loading from zero: z = T (1 - exp(-k x / T)), x = ln 2 T / k and twice that",
        ),
        TestValue(
            {
                "velocity": -0.5,
                "step": 2.0,
                "stiffness": 2.0,
                "torque": 3.0,
                "sharpness": 4.0,
                "state": (3.0,),
            },
            {"force": 2.0, "slope_velocity": 2.0, "next_state": (1.0,)},
            "beta = 1/2: unloading along a straight line of slope k",
        ),
    )
