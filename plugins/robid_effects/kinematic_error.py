"""Kinematic error of a gear: its output runs ahead and behind as the motor turns.

Theory: with an error e(q_m) = amplitude sin(order q_m + phase) the deflection of the gear is x + e(q_m), x = r_g
q_m - q_a (Tuttle and Seering 1996; Ghorbel, Gandhi and Alpeter 2001), hence the torque T = k (x + e) + d (x' + e'
q_m'). A virtual displacement does the work -T (dx + e' dq_m): T acts along x, and the motor feels T e'(q_m)
besides. The linear spring is in the robot already, which leaves two terms, both with the motor angle as their
coordinate: k e + d e' q_m' along the deflection, and T e' along the motor angle, T the whole torque of the
transmission at the joint side. Together they neither make nor lose energy except in the damper d. The law and
its slopes speak of the motor angle. One effect is one order; put several on a gear (strain wave
gears: 2 a motor turn).
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import ForceTerm, kernel, sine_and_cosine


@kernel
def kinematic_error_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque of the error along the deflection; position and velocity are the motor's.

    Parameters: amplitude, order, phase, stiffness and damping of the gear.
    """
    order, stiffness, damping = parameters[1], parameters[3], parameters[4]
    s, c = sine_and_cosine(order * position + parameters[2])
    error, rate = parameters[0] * s, parameters[0] * order * c
    bend = -order * order * error
    return (
        stiffness * error + damping * rate * velocity,
        stiffness * rate + damping * bend * velocity,
        damping * rate,
    )


@kernel
def error_reaction_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque on the motor, load times slope of the error; load: of the transmission, joint side."""
    order = parameters[1]
    s, c = sine_and_cosine(order * position + parameters[2])
    rate = parameters[0] * order * c
    bend = -parameters[0] * order * order * s
    return load * rate, load * bend, 0.0 * velocity


class KinematicError(ForceEffect):
    """Error of the gear's output angle, periodic in the motor angle."""

    source = "Tuttle and Seering 1996, IEEE Trans. Robotics and Automation 12(3); Ghorbel et al. 2001"
    sides = ("gear",)
    law = staticmethod(kinematic_error_law)
    parameters = (
        Parameter("amplitude", "rad", 5e-5, 0.0, 0.1, "of the error, at the joint"),
        Parameter("order", "1/turn", 2.0, 0.0, 1e4, "periods per turn of the motor"),
        Parameter("phase", "rad", 0.0, -2 * np.pi, 2 * np.pi, "of the sine at motor angle zero"),
    )
    test_values = (
        TestValue(
            {"position": np.pi / 4, "velocity": 3.0, "amplitude": 1e-4, "order": 2.0},
            {"force": 0.0, "slope_velocity": 0.0},
            "crest of the error: no rate there; where the file's spring is 0",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Amplitude, order, phase, spring and damper of the robot file."""
        return np.array([*parameters, place.stiffness, place.damping])

    @classmethod
    def bind(cls, parameters: FloatArray, place: Place) -> tuple[ForceTerm, ...]:
        """Return the torque along the deflection and its reaction on the motor, both of the motor angle."""
        arguments, label = cls.arguments(parameters, place), place.label
        return (
            ForceTerm(cls.law, arguments, place.transmission, place.motor, place.load, 0, label),
            ForceTerm(error_reaction_law, arguments, place.motor, place.motor, place.load, 0, label),
        )
