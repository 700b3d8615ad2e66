"""Dress pack of a joint: cables and hoses as a spring with a rest angle, and a damper.

Theory: torque = k (q - q_rest) + d q' of the joint angle. A bent hose gives a nearly linear torque over some tens
of degrees, and a viscous loss; its own friction is left out (friction.* on the arm side has it). A constant torque
k q_rest cannot be distinguished from a friction offset on one pose, and not from gravity on few.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel


@kernel
def cable_spring_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque against the joint angle and its slopes; parameters: stiffness, rest angle, damping."""
    force = parameters[0] * (position - parameters[1]) + parameters[2] * velocity
    return force, parameters[0], parameters[2]


class CableSpring(ForceEffect):
    """Spring and damper of cables and hoses across a joint."""

    source = "Definition: linear spring and damper"
    sides = ("arm",)
    law = staticmethod(cable_spring_law)
    parameters = (
        Parameter("stiffness", "N m/rad", 5.0, 0.0, 1e5, "torque per joint angle"),
        Parameter("rest_angle", "rad", 0.0, -7.0, 7.0, "joint angle without torque"),
        Parameter("damping", "N m s/rad", 0.5, 0.0, 1e5, "torque per joint speed"),
    )
    test_values = (
        TestValue(
            {"position": 1.0, "velocity": 2.0, "stiffness": 10.0, "rest_angle": -0.5, "damping": 1.5},
            {"force": 18.0, "slope_position": 10.0, "slope_velocity": 1.5},
            "definition: 10 * 1.5 + 1.5 * 2",
        ),
    )

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """At rest at zero: another rest angle is a constant torque more."""
        return ({"rest_angle": 0.0},)

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Torque per unit of stiffness at the given rest angle, and of damping."""
        return {
            "stiffness": np.asarray(position, dtype=float) - parameters[1],
            "damping": np.asarray(velocity, dtype=float),
        }
