"""A linear spring with a damper beside those of the robot file.

Theory: torque = k x + d v of a deflection x (thesis eq. 2.2). Put on a gear or a bearing it says how much stiffer
and better damped the place is than the file has it, with an interval of its own; two of them on one place are one.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel


@kernel
def spring_damper_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: stiffness, damping."""
    return parameters[0] * position + parameters[1] * velocity, parameters[0], parameters[1]


class SpringDamper(ForceEffect):
    """Additional linear spring and damper in the gear or across it."""

    source = "Zimmermann, thesis eq. (2.2)"
    sides = ("gear", "bearing")
    law = staticmethod(spring_damper_law)
    parameters = (
        Parameter("stiffness", "N m/rad", 1e4, 0.0, 1e9, "torque per deflection, joint side"),
        Parameter("damping", "N m s/rad", 0.0, 0.0, 1e7, "torque per speed of the deflection"),
    )
    test_values = (
        TestValue(
            {"position": 1e-3, "velocity": -0.2, "stiffness": 5e4, "damping": 10.0},
            {"force": 48.0, "slope_position": 5e4, "slope_velocity": 10.0},
            "definition: 50 - 2",
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
        """Torque per unit of stiffness and of damping."""
        return {"stiffness": np.asarray(position, dtype=float), "damping": np.asarray(velocity, dtype=float)}
