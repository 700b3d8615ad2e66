"""Soft wind-up zone of a gear: soft around zero torque, stiff outside, with friction inside the gear.

Theory: Good, Sweet and Strobel (1985) describe a robot's gear by a stiffening spring with viscous damping beside
it, and add Coulomb friction and a current limit of the motor (thesis section 2.4); strain wave gears show the soft
zone and a hysteresis loop around it (Schempf 1990). Here: within half of `zone` the stiffness is `softness` times
that of the robot file's spring, beyond one and a half times it is the file's, in between it rises linearly; a
torque hysteresis tanh(v / speed) works against the deflection. The rest of their model stands in the robot file:
gear.damping, the motor's friction, torque_limit. The loop is one of speed and closes at rest; for one that stays,
put transmission.maxwell_slip in place of this friction.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, smooth_sign
from robid_effects.deflection import SMALLEST_RADIUS, dead_zone, swept_radius


@kernel
def soft_zone_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque less the linear spring's; parameters: see `SoftZone.arguments`."""
    corner, radius, softening, hysteresis, speed = (
        parameters[0],
        parameters[1],
        parameters[2],
        parameters[3],
        parameters[4],
    )
    swept, wider = swept_radius(radius, velocity, step)
    beyond, share, by_radius = dead_zone(position, corner, swept)
    missing = softening * (beyond - position)
    level = smooth_sign(velocity / speed)
    damping = hysteresis / speed * (1.0 - level * level)
    damping += softening * by_radius * wider
    return missing + hysteresis * level, softening * (share - 1.0), damping


class SoftZone(ForceEffect):
    """Soft zone around zero torque, with friction in the gear."""

    source = "Good, Sweet and Strobel 1985, J. Dynamic Systems, Measurement, and Control 107(1); Schempf 1990"
    sides = ("gear",)
    law = staticmethod(soft_zone_law)
    parameters = (
        Parameter("softness", "1", 0.4, 1e-3, 1.0, "stiffness in the zone over that of the robot file"),
        Parameter("zone", "rad", 5e-4, 0.0, 0.1, "full width of the zone, joint side"),
        Parameter("hysteresis", "N m", 1.0, 0.0, 1e5, "level of the friction in the gear, joint side"),
        Parameter("speed", "rad/s", 5e-3, 1e-7, 1e2, "smoothing speed of that friction, of the deflection"),
    )
    test_values = (
        TestValue(
            {"position": 3e-4, "velocity": 1.0, "hysteresis": 2.5, "speed": 1e-2},
            {"force": 2.5, "slope_position": 0.0},
            "friction alone, tanh(100) = 1; where the file's spring is 0",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Corner, its radius, missing stiffness inside; hysteresis, its speed."""
        softness, zone, hysteresis, speed = parameters
        radius = max(0.25 * zone, SMALLEST_RADIUS)
        missing = place.stiffness * (1 - softness)
        return np.array([0.5 * zone, radius, missing, hysteresis, speed])

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Torque per unit of hysteresis at the given smoothing speed; the spring is not linear in its parameters."""
        return {"hysteresis": np.tanh(np.asarray(velocity, dtype=float) / parameters[3])}
