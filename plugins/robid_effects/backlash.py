"""Backlash of a gear: a gap between two flanks, each as stiff as the robot file's spring.

Theory: torque = k D(x) + d D'(x) v with the dead zone D(x) = 0 for |x| < gap / 2 and x -+ gap / 2 beyond (Nordin
and Gutman 2002, Automatica 38): spring and damper of the robot file act on the flanks only. Two departures keep it
computable. The corners are rounded within a tenth of the gap (`rounding`, 0.2 of the half gap; a contact is soft at
first anyway), and inside a thousandth of the spring stays (RESIDUAL), without which an unloaded joint would have no
equilibrium. A gap that is passed within a step of a simulation acts by its mean over the step (see `deflection`). The
law returns the difference to the linear spring and damper. Under a sine of amplitude A the spring
acts as k N(A), N = 1 - (2 / pi) (asin mu + mu sqrt(1 - mu^2)), mu = gap / (2 A) (Gelb and Vander Velde 1968); under a
Gaussian by the share of time on the flanks. Backlash lowers a resonance that swings through the gap and does nothing
to a joint that gravity holds on one flank.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, where
from robid_effects.deflection import SMALLEST_RADIUS, dead_zone, swept_radius

TOUCHED = 1e-3  # of the time on a flank, or more: it is touched
RESIDUAL = 1e-3
"""Share of spring and damper that stays inside the gap."""


@kernel
def backlash_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque less that of the linear spring and damper; parameters: see `Backlash.arguments`."""
    half, share = parameters[0], 1.0 - RESIDUAL
    stiffness, damping = share * parameters[2], share * parameters[3]
    radius, wider = swept_radius(parameters[1], velocity, step)
    beyond, contact, rise = dead_zone(position, half, radius)
    force = stiffness * (beyond - position) + damping * (contact - 1.0) * velocity
    above, below = position - half, -position - half
    bend_above = where(abs(above) < radius, 1.0 / (2.0 * radius), 0.0)
    bend_below = where(abs(below) < radius, 1.0 / (2.0 * radius), 0.0)
    by_position = stiffness * (contact - 1.0) + damping * velocity * (bend_above - bend_below)
    by_radius = stiffness * rise - damping * velocity * (bend_above * above + bend_below * below) / radius
    return force, by_position, damping * (contact - 1.0) + by_radius * wider


class Backlash(ForceEffect):
    """Backlash: a gap in the gear, centred on zero deflection."""

    source = "Nordin and Gutman 2002, Automatica 38(10); Gelb and Vander Velde 1968"
    sides = ("gear",)
    smoothest = {"rounding": 0.9}
    law = staticmethod(backlash_law)
    parameters = (
        Parameter("gap", "rad", 3e-4, 0.0, 0.1, "full width, joint side (1 arc minute is 2.9e-4 rad)"),
        Parameter(
            "rounding",
            "1",
            0.2,
            0.02,
            1.0,
            "radius of the corners over half the gap: how soft contact is",
        ),
    )
    test_values = (
        TestValue(
            {"position": -8e-4, "velocity": 0.1, "gap": 6e-4, "stiffness": 1e5, "damping": 50.0},
            {"force": 0.999 * 30.0, "slope_position": 0.0, "slope_velocity": 0.0},
            "on the flank the file's spring and damper act, half the gap late: 1e5 * 3e-4, less the residual",
        ),
        TestValue(
            {"position": 1e-4, "velocity": 0.1, "gap": 6e-4, "stiffness": 1e5, "damping": 50.0},
            {"force": -0.999 * 15.0, "slope_position": -0.999e5, "slope_velocity": -0.999 * 50.0},
            "inside the gap the file's spring and damper, 10 + 5 N m, are taken away but for the residual",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Half the gap, radius of its corners, spring and damper of the robot file."""
        gap, rounding = parameters
        radius = max(0.5 * rounding * gap, SMALLEST_RADIUS)
        return np.array([0.5 * gap, radius, place.stiffness, place.damping])

    @classmethod
    def hardly_told(
        cls, parameters: FloatArray, place: Place, positions: Sequence[FloatArray]
    ) -> Mapping[str, str]:
        """The width of the gap, where no experiment touches both flanks."""
        del place
        half, depth = 0.5 * float(parameters[0]), 0.0
        for position in positions:
            upper, lower = (position > half).mean(), (position < -half).mean()
            if min(upper, lower) >= TOUCHED:
                return {}
            depth = max(depth, half - position.min() if upper > lower else half + position.max())
        least = (
            f", but for being more than {depth:.2g} rad, by which motions went into it" if depth > 0 else ""
        )
        return {
            "gap": "no experiment that counts touches both flanks of the gap as it was found: its width is not "
            f"determined{least}. Measure poses in which gravity is balanced, or faster moves"
        }
