"""Torque constant that is off: the motor gives another torque than the drive believes.

Theory: the drive commands a torque as a current, u / k; the motor turns it into k_true u / k = (1 + error) u.
Neodymium magnets lose about 0.1 % of flux per kelvin. Reported torque is the commanded one, so a rotor inertia
that is off by the inverse looks alike: slow runs, where gravity is known, separate the two.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel


@kernel
def torque_constant_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Acting torque."""
    return signal + parameters[0] * signal


class TorqueConstantError(SignalEffect):
    """Error of the torque constant: the acting torque is the commanded one times a factor."""

    source = "Definition; Hanselman 1994, Brushless Permanent-Magnet Motor Design"
    channels = ("torque",)
    law = staticmethod(torque_constant_law)
    parameters = (Parameter("error", "1", 0.05, -0.9, 10.0, "relative error: acting / commanded - 1"),)
    test_values = (TestValue({"signal": 4.0, "error": 0.05}, {"signal": 4.2}, "definition"),)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1 + error."""
        return np.full(np.shape(omega), 1 + parameters[0], dtype=np.complex128)

    @classmethod
    def regressor(
        cls, signal: FloatArray, angle: FloatArray, speed: FloatArray, parameters: FloatArray, place: Place
    ) -> dict[str, FloatArray]:
        """Change of the torque per unit of error."""
        return {"error": np.asarray(signal, dtype=float)}
