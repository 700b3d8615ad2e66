"""Torque ripple and cogging: the torque of a motor waves with its angle.

Theory: acting torque = u + (amplitude + relative u) sin(order angle + phase), u the commanded one. Harmonics of
flux and current give a ripple in proportion to the current, at the sixth and twelfth multiple of the pole pairs;
slots that attract the magnets (cogging) and errors of current measurement give one of constant size (thesis
section 3.1.3; Gutt, Scholl and Blattner 1996; Hanselman 1994). One effect is one order; put several on an axis.
Over a step the mean is taken, so that a fast turn is not sampled as a slow wave. A small multisine sees 1
+ relative E[sin]: next to 1 as soon as the motor swings over a period of the wave; the ripple itself does not
depend on the phases of the multisine.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import kernel, sine
from robid_effects.angle_wave import cardinal_sine, mean_wave

ORDER = Parameter(
    "order", "1/turn", 12.0, 0.0, 1e4, "periods per turn of the motor (whole: closes after a turn)"
)
PHASE = Parameter("phase", "rad", 0.0, -2 * np.pi, 2 * np.pi, "of the sine at motor angle zero")


@kernel
def torque_ripple_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Acting torque, mean over the step; parameters: amplitude, relative, order, phase."""
    order = parameters[2]
    wave = sine(order * angle + parameters[3]) * cardinal_sine(0.5 * order * speed * step)
    return signal + (parameters[0] + parameters[1] * signal) * wave


class TorqueRipple(SignalEffect):
    """Torque ripple of one order of the motor angle: a constant part and a part in proportion to the torque."""

    source = "Gutt, Scholl and Blattner 1996; Hanselman 1994; thesis section 3.1.3"
    channels = ("torque",)
    law = staticmethod(torque_ripple_law)
    parameters = (
        Parameter("amplitude", "N m", 0.1, 0.0, 1e4, "constant part"),
        Parameter("relative", "1", 0.0, -1.0, 1.0, "part in proportion to the torque"),
        ORDER,
        PHASE,
    )
    test_values = (
        TestValue(
            {"signal": 2.0, "angle": np.pi / 12, "amplitude": 0.1, "relative": 0.05, "order": 6.0},
            {"signal": 2.2},
            "crest of the sine: 2 + (0.1 + 0.05 * 2)",
        ),
    )

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1 + relative E[sin(order angle + phase)]."""
        _, relative, order, phase = parameters
        mean = 1 + relative * mean_wave(order, phase, motion).imag
        spread: ComplexArray = mean[..., None] * np.ones(np.shape(omega), dtype=np.complex128)
        return spread

    @classmethod
    def regressor(
        cls, signal: FloatArray, angle: FloatArray, speed: FloatArray, parameters: FloatArray, place: Place
    ) -> dict[str, FloatArray]:
        """Change of the torque per unit of amplitude and of the relative part."""
        wave = np.sin(parameters[2] * angle + parameters[3])
        return {"amplitude": wave, "relative": signal * wave}


class Cogging(SignalEffect):
    """Cogging of one order of the motor angle: torque ripple that is present without current."""

    source = "Hanselman 1994; Gutt, Scholl and Blattner 1996"
    channels = ("torque",)
    law = staticmethod(torque_ripple_law)
    parameters = (Parameter("amplitude", "N m", 0.1, 0.0, 1e4, "of the wave"), ORDER, PHASE)
    test_values = (
        TestValue(
            {"signal": 2.0, "angle": np.pi / 12, "amplitude": 0.1, "order": 6.0},
            {"signal": 2.1},
            "crest of the sine: 2 + 0.1",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Amplitude, no part in proportion to the torque, order, phase."""
        return np.insert(np.asarray(parameters, dtype=np.float64), 1, 0.0)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """1: what is added does not depend on the torque."""
        return np.ones(np.shape(omega), dtype=np.complex128)

    @classmethod
    def regressor(
        cls, signal: FloatArray, angle: FloatArray, speed: FloatArray, parameters: FloatArray, place: Place
    ) -> dict[str, FloatArray]:
        """Change of the torque per unit of amplitude."""
        return {"amplitude": np.sin(parameters[1] * angle + parameters[2])}
