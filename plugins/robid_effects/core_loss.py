"""Losses in a motor's iron that grow with the torque squared: the shaft has less torque than the current makes.

Theory: turning the field once round costs hysteresis energy in proportion to about the square of the flux density
(C. P. Steinmetz 1892, exponent 1.6 to 2) and eddy currents in proportion to square and speed. Armature reaction adds
a field in proportion to the current, so to the torque u; the loss over the speed is a torque against the motion,
``(h + e |v|) u^2 sign(v)``. What the magnets' own field loses does not depend on the current and is Coulomb and viscous
friction. Unlike friction that grows with a gear's load it is there in an unloaded motor that accelerates, and unlike a
wrong torque constant it helps to brake. The sign is smoothed as tanh(v / v_s).
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel, smooth_sign


@kernel
def core_loss_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Acting torque; parameters: hysteresis, eddy, zero_speed."""
    per_square = parameters[0] + parameters[1] * abs(speed)
    return signal - per_square * signal * signal * smooth_sign(speed / parameters[2])


class CoreLoss(SignalEffect):
    """Iron losses (hysteresis, eddy currents) by the armature's field: a braking torque by torque squared."""

    source = (
        "C. P. Steinmetz, On the law of hysteresis, Transactions of the American Institute of Electrical Engineers 9, "
        "1892; Hanselman 1994, Brushless Permanent-Magnet Motor Design"
    )
    channels = ("torque",)
    law = staticmethod(core_loss_law)
    parameters = (
        Parameter("hysteresis", "1/(N m)", 1e-3, 0.0, 1.0, "loss per torque squared, h"),
        Parameter("eddy", "s/(N m rad)", 0.0, 0.0, 1.0, "its growth with speed, e"),
        Parameter("zero_speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign, v_s"),
    )
    test_values = (
        TestValue(
            {"signal": 10.0, "speed": 50.0, "hysteresis": 2e-3, "eddy": 1e-5},
            {"signal": 10.0 - 0.2 - 0.05},
            "by hand: driving, the loss takes torque away",
        ),
        TestValue(
            {"signal": -10.0, "speed": 50.0, "hysteresis": 2e-3},
            {"signal": -10.2},
            "by hand: braking, the loss helps",
        ),
    )

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1: the sign of a speed that is symmetric about zero has no mean."""
        return np.ones(np.shape(omega), dtype=np.complex128)

    @classmethod
    def regressor(
        cls, signal: FloatArray, angle: FloatArray, speed: FloatArray, parameters: FloatArray, place: Place
    ) -> dict[str, FloatArray]:
        """Change of the torque per unit of both coefficients."""
        square = np.tanh(speed / parameters[2]) * np.square(signal)
        return {"hysteresis": -square, "eddy": -square * np.abs(speed)}
