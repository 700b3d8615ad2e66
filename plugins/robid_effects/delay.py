"""Delay of a measurement: position or torque is reported late, by any time, not only whole samples.

Theory: reported[k] = true(k T - delay). Between samples the signal is read off the cubic through the four samples
around (Lagrange; Laakso et al. 1996, Splitting the unit delay): at a twelfth of the sampling frequency a delay of
half a sample is 0.2 % off where it lies between the two middle samples, 0.3 % where, below one sample, there are
none on its younger side; linear interpolation would take 3 % of the amplitude. Whole samples are exact. State:
started, then the samples, newest first; at the first call the line fills with the signal.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Motion, Parameter, Place, SignalEffect, TestValue
from robid_core.mechanics import SignalTerm, kernel, where


@kernel
def delay_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Reported value: the four oldest samples by their weights; parameters: those, and the length of the state."""
    n = int(parameters[4])
    started = state[0] > 0.5
    next_state[0] = 1.0
    next_state[1] = signal
    for i in range(2, n):
        next_state[i] = where(started, state[i - 1], signal)
    oldest = where(started, state[n - 1], signal)
    middle = parameters[1] * next_state[n - 2] + parameters[2] * next_state[n - 1]
    return parameters[0] * next_state[n - 3] + middle + parameters[3] * oldest


def samples_before(delay: float, sample_time: float) -> int:
    """Whole samples between now and the youngest of the four that the cubic goes through."""
    return max(int(np.floor(delay / sample_time + 1e-9)) - 1, 0)


def cubic_weights(offset: float) -> FloatArray:
    """Weights of samples 0, 1, 2, 3 for the value at `offset` samples of the cubic through them, shape (4,)."""
    nodes = np.arange(4.0)
    factors = (offset - nodes)[None, :] / np.where(np.eye(4) > 0, 1.0, nodes[:, None] - nodes[None, :])
    weights: FloatArray = np.where(np.eye(4) > 0, 1.0, factors).prod(axis=1)
    return weights


class Delay(SignalEffect):
    """Constant delay of what the drive reports."""

    source = "Laakso, Valimaki, Karjalainen and Laine 1996, Splitting the unit delay"
    channels = ("position", "torque_measurement")
    law = staticmethod(delay_law)
    n_state = 4  # started, three samples; bind adds one for every whole sample before the youngest
    parameters = (Parameter("delay", "s", 5e-4, 0.0, 0.05, "from the instant to its report"),)
    test_values = (
        TestValue(
            {"signal": 4.5, "delay": 1.5e-3, "state": (1.0, 4.0, 3.5, 3.0)},
            {"signal": 3.75, "next_state": (1.0, 4.5, 4.0, 3.5)},
            "a ramp of 0.5 a sample, one and a half samples of 1 ms late",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Weights of the four samples, and the length of the state."""
        before = samples_before(parameters[0], place.sample_time)
        offset = parameters[0] / place.sample_time - before
        whole = float(np.rint(offset))
        return np.append(cubic_weights(whole if abs(offset - whole) < 1e-9 else offset), cls.n_state + before)

    @classmethod
    def bind(cls, parameters: FloatArray, place: Place) -> tuple[SignalTerm, ...]:
        """One term, with as many samples in its state as the delay needs."""
        arguments = cls.arguments(parameters, place)
        n_state = int(arguments[-1])
        return (SignalTerm(cls.law, arguments, place.axis, place.side, n_state, None, place.label),)

    @classmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """That of the law: sum of weights times exp(-i w T samples), exp(-i w delay) but for the interpolation."""
        first = samples_before(parameters[0], place.sample_time)
        phase = np.asarray(omega, dtype=float)[..., None] * place.sample_time * (first + np.arange(4))
        gain: ComplexArray = np.exp(-1j * phase) @ cls.arguments(parameters, place)[:4]
        return gain
