"""Gain error of a measurement: what is reported is in proportion to what is there.

Theory: reported = (1 + error) true. On the reported torque it is a wrong torque constant or current sensor that
the motion does not know of; on the position a wrong gear ratio or a wrong number of counts. Reciprocity of the
joint-side response determines gains of axes relative to one another, but no common factor.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel


@kernel
def gain_error_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Reported value."""
    return signal + parameters[0] * signal


class GainError(SignalEffect):
    """Gain error of a sensor: the reported value is the true one times a factor."""

    source = "Definition"
    channels = ("torque_measurement", "position")
    law = staticmethod(gain_error_law)
    parameters = (Parameter("error", "1", 0.02, -0.9, 10.0, "relative error: reported / true - 1"),)
    test_values = (TestValue({"signal": 4.0, "error": 0.02}, {"signal": 4.08}, "definition"),)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1 + error."""
        return np.full(np.shape(omega), 1 + parameters[0], dtype=np.complex128)

    @classmethod
    def regressor(
        cls, signal: FloatArray, angle: FloatArray, speed: FloatArray, parameters: FloatArray, place: Place
    ) -> dict[str, FloatArray]:
        """Change of the reported value per unit of error."""
        return {"error": np.asarray(signal, dtype=float)}
