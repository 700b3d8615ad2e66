"""A spring that gets stiffer as it deflects: the robot file's spring plus a cubic one.

Theory: torque = k x + c x^3 (thesis section 2.4, "a nonlinear function replacing the linear relation"; the Duffing
spring). A small multisine sees k + 3 c E[x^2]: more with the amplitude of the motion, so that a resonance rises,
and more with the deflection under gravity; which of the two distinguishes it from backlash. First harmonic of a
sine of amplitude A: k + 3/4 c A^2.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel


@kernel
def stiffening_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: cubic."""
    slope = parameters[0] * position * position
    return slope * position, 3.0 * slope, 0.0 * velocity


class Stiffening(ForceEffect):
    """Cubic spring beside the linear one of a gear or bearing."""

    source = "Zimmermann, thesis section 2.4; G. Duffing 1918"
    sides = ("gear", "bearing")
    law = staticmethod(stiffening_law)
    parameters = (
        Parameter("cubic", "N m/rad^3", 1e9, 0.0, 1e16, "torque per cube of the deflection, joint side"),
    )
    test_values = (
        TestValue(
            {"position": -2e-3, "cubic": 1e10},
            {"force": -80.0, "slope_position": 1.2e5, "slope_velocity": 0.0},
            "definition: 1e10 * 8e-9, 3e10 * 4e-6",
        ),
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
        """Torque per unit of the cubic coefficient."""
        return {"cubic": np.asarray(position, dtype=float) ** 3}
