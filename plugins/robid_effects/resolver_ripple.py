"""Resolver ripple: the measured motor angle waves with the angle itself.

Theory: measured = angle + amplitude sin(order angle + phase). A relative difference a of the two windings'
amplitudes gives a/2 sin(2 angle), an error b of their right angle b/2 cos(2 angle) and a constant, offsets give
order 1, all per electrical turn: times the pole pairs per turn of the motor (Hanselman 1990; thesis section
3.1.3). The controller sees it: measured speed is amplitude order speed cos(...) off. A small multisine sees
1 + amplitude order E[cos], near 1 once the motor swings over a period of the wave.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel, sine
from robid_effects.angle_wave import mean_wave


@kernel
def resolver_ripple_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Measured angle; parameters: amplitude, order, phase. The wave is that of the true angle."""
    return signal + parameters[0] * sine(parameters[1] * angle + parameters[2])


class ResolverRipple(SignalEffect):
    """Error of the measured motor angle, periodic in that angle, of one order."""

    source = "Hanselman 1990, Resolver signal requirements for high accuracy resolver-to-digital conversion"
    channels = ("position",)
    law = staticmethod(resolver_ripple_law)
    parameters = (
        Parameter("amplitude", "rad", 5e-4, 0.0, 0.5, "of the wave, at the motor"),
        Parameter("order", "1/turn", 2.0, 0.0, 1e4, "periods per turn of the motor"),
        Parameter("phase", "rad", 0.0, -2 * np.pi, 2 * np.pi, "of the sine at motor angle zero"),
    )
    test_values = (
        TestValue(
            {"signal": 0.6, "angle": 0.6, "amplitude": 0.5e-4, "order": 2.0},
            {"signal": float(np.arctan2((1 + 1e-4) * np.sin(0.6), np.cos(0.6)))},
            "resolver whose sine winding is 1e-4 too strong, to second order in that",
            tolerance=1e-8,
        ),
    )

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1 + amplitude order E[cos(order angle + phase)]."""
        amplitude, order, phase = parameters
        mean = 1 + amplitude * order * mean_wave(order, phase, motion).real
        spread: ComplexArray = mean[..., None] * np.ones(np.shape(omega), dtype=np.complex128)
        return spread

    @classmethod
    def regressor(
        cls, signal: FloatArray, angle: FloatArray, speed: FloatArray, parameters: FloatArray, place: Place
    ) -> dict[str, FloatArray]:
        """Change of the measured angle per unit of amplitude."""
        return {"amplitude": np.sin(parameters[1] * angle + parameters[2])}
