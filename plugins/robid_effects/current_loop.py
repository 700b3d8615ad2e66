"""Current loop of the drive: the torque follows its command late, after a dead time and a first-order lag.

Theory: T y' + y = u(t - delay), gain exp(-i w delay) / (1 + i w T); T is the inverse bandwidth of the closed
current loop, the delay that of computing and of the pulse-width modulation, 1.5 of its periods (Buso and
Mattavelli 2015). Commands are held, so both are exact at any step: within a step of length h the delayed command
jumps once, after f h, where delay = (m + f) h; over each piece the lag decays exponentially, and the integral of
both pieces over h is the mean torque. State: started, y, and the last m + 1 commands. At the first call the loop
has settled on its command.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import SignalTerm, kernel, where


@kernel
def current_loop_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Mean torque over the step; parameters: see `lag_over_step`, and last the length of the state."""
    n = int(parameters[5])
    started = state[0] > 0.5
    next_state[0] = 1.0
    next_state[2] = signal
    for i in range(3, n):
        next_state[i] = where(started, state[i - 1], signal)
    before = where(started, state[n - 1], signal)
    after = next_state[n - 1]
    off_before = where(started, state[1], signal) - before
    off_after = before + off_before * parameters[1] - after
    next_state[1] = after + off_after * parameters[2]
    held = after + parameters[0] * (before - after)
    return held + off_before * parameters[3] + off_after * parameters[4]


def whole_and_share(delay: float, step: float) -> tuple[int, float]:
    """Split a delay into whole steps and the share of one more; within 1e-9 of a step it is whole."""
    steps = delay / step
    whole = int(np.floor(steps + 1e-9))
    return whole, max(steps - whole, 0.0)


def lag_over_step(share: float, time_constant: float, step: float) -> FloatArray:
    """Share f, decay over f h and over (1 - f) h, and the integral of either divided by h, shape (5,).

    Exact for held commands; time_constant 0 is no lag.
    """
    pieces = np.array([share, 1 - share]) * step
    if time_constant == 0:
        return np.array([share, 0.0, 0.0, 0.0, 0.0])
    fall = -np.expm1(-pieces / time_constant)
    return np.concatenate([[share], 1 - fall, fall * time_constant / step])


class CurrentLoop(SignalEffect):
    """Dead time and first-order lag between commanded and acting torque."""

    source = "Buso and Mattavelli 2015, Digital Control in Power Electronics, chapter 3"
    channels = ("torque",)
    law = staticmethod(current_loop_law)
    n_state = 3  # started, y, one command; bind adds one for every whole step of delay
    parameters = (
        Parameter("time_constant", "s", 5e-4, 0.0, 1.0, "of the lag; 0: none"),
        Parameter("delay", "s", 0.0, 0.0, 0.05, "dead time"),
    )
    test_values = (
        TestValue(
            {"signal": 1.0, "step": 2.5e-4, "state": (1.0, 0.0, 1.0), "time_constant": 5e-4},
            {"signal": 1 - 2 * (1 - np.exp(-0.5)), "next_state": (1.0, 1 - np.exp(-0.5), 1.0)},
            "step response 1 - exp(-t / T): its mean over, and its value after, half a time constant",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Share, decays and their means for the step of the place, and the length of the state."""
        time_constant, delay = parameters
        whole, share = whole_and_share(delay, place.step)
        return np.append(lag_over_step(share, time_constant, place.step), cls.n_state + whole)

    @classmethod
    def bind(cls, parameters: FloatArray, place: Place) -> tuple[SignalTerm, ...]:
        """One term, with as many commands in its state as the delay needs."""
        arguments = cls.arguments(parameters, place)
        n_state = int(arguments[-1])
        return (SignalTerm(cls.law, arguments, place.axis, place.side, n_state, None, place.label),)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """exp(-i w delay) / (1 + i w T)."""
        time_constant, delay = parameters
        w = np.asarray(omega, dtype=float)
        gain: ComplexArray = np.exp(-1j * w * delay) / (1 + 1j * w * time_constant)
        return gain
