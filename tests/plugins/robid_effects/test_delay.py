"""Delay of a measurement: whole samples exactly, fractions to the accuracy of a cubic."""

import numpy as np
import pytest

from robid_core import Motion
from robid_effects.delay import Delay

SAMPLE = 1e-3


@pytest.mark.parametrize("whole", [0, 1, 2, 5])
def test_whole_samples_are_exact(at, through, whole: int) -> None:
    signal = np.random.default_rng(5).standard_normal(30)
    out = through(Delay, signal, at("position"), delay=whole * SAMPLE)
    np.testing.assert_array_equal(out[whole:], signal[: 30 - whole])
    np.testing.assert_array_equal(out[:whole], signal[0])


@pytest.mark.parametrize("delay", [0.25, 0.5, 1.4, 3.9])
def test_a_cubic_comes_out_as_it_was(at, through, delay: float) -> None:
    k = np.arange(40.0)
    cubic = np.polynomial.Polynomial([2.0, -0.3, 0.05, 0.002])
    out = through(Delay, cubic(k), at("position"), delay=delay * SAMPLE)
    np.testing.assert_allclose(out[8:], cubic(k[8:] - delay), rtol=1e-12)


@pytest.mark.parametrize("channel", ["position", "torque_measurement"])
@pytest.mark.parametrize("delay", [0.3, 0.5, 1.5, 2.75])
def test_a_sine_is_late_by_the_delay(at, through, channel: str, delay: float) -> None:
    """Remainder of the cubic through samples 0..3 at x: (w T)^4 / 24 |x (x-1) (x-2) (x-3)|."""
    n, whole = 240, max(int(delay) - 1, 0)
    x = delay - whole
    product = abs(x * (x - 1) * (x - 2) * (x - 3))
    for bin_ in (1, 4, 20):
        w = 2 * np.pi * bin_ / n
        signal = np.cos(w * np.arange(2 * n))
        out = through(Delay, signal, at(channel), delay=delay * SAMPLE)[n:]
        line = np.fft.rfft(out)[bin_] / np.fft.rfft(signal[n:])[bin_]
        gain = Delay.gain(np.array([delay * SAMPLE]), at(channel), np.array([w / SAMPLE]), Motion())[0]
        assert line == pytest.approx(gain, abs=1e-12)
        assert abs(line - np.exp(-1j * w * delay)) <= w**4 / 24 * product + 1e-12
    assert np.angle(gain) / w == pytest.approx(-delay, abs=w**3 / 24 * product)


def test_the_accuracy_that_the_docstring_states(at) -> None:
    """At a twelfth of the sampling frequency, half a sample between: 0.2 %, 0.3 % at the edge, linear 3.4 %."""
    w = 2 * np.pi / 12
    for delay, share in ((1.5, 0.0018), (0.5, 0.003)):
        gain = Delay.gain(np.array([delay * SAMPLE]), at("position"), np.array([w / SAMPLE]), Motion())[0]
        assert 0.8 * share < abs(gain * np.exp(1j * w * delay) - 1) < share
    assert 1 - np.cos(w / 2) == pytest.approx(0.034, abs=5e-4)


def test_the_line_fills_at_the_first_call(at, through) -> None:
    out = through(Delay, np.full(12, 250.0), at("position"), delay=3.3e-3)
    np.testing.assert_allclose(out, 250.0, rtol=1e-15)


def test_the_state_holds_as_many_samples_as_the_delay_needs(at) -> None:
    for delay, length in ((0.0, 4), (0.9, 4), (1.2, 4), (2.0, 5), (3.5, 6)):
        (term,) = Delay.bind(np.array([delay * SAMPLE]), at("position"))
        assert term.n_state == length
        assert term.arguments[:4].sum() == pytest.approx(1, abs=1e-15)
