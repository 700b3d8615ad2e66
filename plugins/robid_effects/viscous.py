"""Viscous friction: a torque proportional to speed, as a film of lubricant gives it.

Theory: ``F = d v`` (O. Reynolds, On the theory of lubrication, 1886; thesis section 2.5). In a robot's joint
d is that of motor bearings, seals and the churning of grease; it falls as the gear warms up
(`friction.temperature`). Linear: a small signal sees d whatever else moves.
"""

from __future__ import annotations

import numpy as np

from robid_core import Equivalent, FloatArray, ForceEffect, Motion, Parameter, Place, TestValue
from robid_core.mechanics import kernel


@kernel
def viscous_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: viscous."""
    return parameters[0] * velocity, 0.0 * position, parameters[0] + 0.0 * velocity


class Viscous(ForceEffect):
    """Viscous friction."""

    source = "thesis section 2.5, after O. Egeland, J. T. Gravdahl, Modeling and Simulation for Automatic Control, 2002"
    sides = ("motor", "gear", "arm", "bearing")
    searched_at = ("arm",)
    parameters = (Parameter("viscous", "N m s/rad", 0.005, 0.0, 1e6, "torque per speed, d"),)
    law = staticmethod(viscous_law)
    test_values = (
        TestValue({"velocity": -3.0, "viscous": 0.02}, {"force": -0.06, "slope_velocity": 0.02}, "by hand"),
    )

    @classmethod
    def linearize(cls, parameters: FloatArray, place: Place, motion: Motion) -> Equivalent:
        """The coefficient itself."""
        shape = np.broadcast_shapes(np.shape(motion.velocity_rms), np.shape(motion.sine_speed))
        return Equivalent(np.zeros(shape), np.full(shape, parameters[0]))

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Force per unit of the coefficient: the speed."""
        return {"viscous": velocity}
