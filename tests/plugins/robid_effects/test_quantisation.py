"""Quantisation: uniform error, and the equivalent gain where the signal moves over few steps."""

import numpy as np
import pytest

from robid_core import Motion
from robid_effects.quantisation import Quantisation, quantiser_gain


def test_the_error_is_uniform_and_white(at, through) -> None:
    """N = 100 000 draws over 10 steps: error variance q^2 / 12 with relative standard error sqrt(0.8 / N)."""
    n, q = 100_000, 0.02
    signal = 10 * q * np.random.default_rng(9).standard_normal(n)
    error = (through(Quantisation, signal, at("position"), resolution=q) - signal) / q
    assert np.abs(error).max() <= 0.5 * (1 + 1e-9)
    assert error.mean() == pytest.approx(0, abs=5 * np.sqrt(1 / 12 / n))
    assert 12 * error.var() == pytest.approx(1, abs=5 * np.sqrt(0.8 / n))
    assert 12 * (error[1:] @ error[:-1]) / n == pytest.approx(0, abs=5 / np.sqrt(n))
    assert error @ signal / (10 * q) / n == pytest.approx(0, abs=5 * np.sqrt(1 / 12 / n))


def test_every_output_is_a_multiple_of_the_resolution(at, through) -> None:
    q = 2 * np.pi / 4096
    out = through(Quantisation, np.linspace(-3, 3, 101), at("position"), resolution=q)
    np.testing.assert_allclose(out / q, np.rint(out / q), atol=1e-9)


@pytest.mark.parametrize(
    ("mean", "rms", "amplitude"), [(0.0, 0.2, 0.0), (0.5, 0.2, 0.0), (0.3, 0.1, 0.6), (0, 0.5, 0)]
)
def test_the_gain_is_that_of_many_draws(mean: float, rms: float, amplitude: float) -> None:
    """E[slope] by the covariance with the Gaussian part (Stein), 400 000 draws, 5 standard errors."""
    rng = np.random.default_rng(10)
    gaussian = rng.standard_normal(400_000)
    signal = mean + rms * gaussian + amplitude * np.sin(2 * np.pi * rng.random(400_000))
    products = np.rint(signal) * gaussian / rms
    error = products.std() / np.sqrt(len(products))
    assert float(quantiser_gain(1.0, mean, rms, amplitude)) == pytest.approx(products.mean(), abs=5 * error)


def test_from_half_a_step_on_the_gain_is_one_within_two_per_cent(at) -> None:
    means = np.linspace(0, 1, 21)
    assert np.abs(quantiser_gain(1.0, means, 0.5, 0.0) - 1).max() < 0.02
    for motion, channel in ((Motion(position_rms=0.1), "position"), (Motion(sine_speed=3.0), "position"),
                            (Motion(), "position"), (Motion(position_rms=1e-5), "torque_measurement")):  # fmt: skip
        gain = Quantisation.gain(np.array([1e-3]), at(channel), np.array([1.0, 2.0]), motion)
        np.testing.assert_allclose(gain, 1, atol=1e-3)
    few = Quantisation.gain(np.array([1e-3]), at("position"), np.array([1.0]), Motion(position_rms=1e-4))
    assert few[0] == pytest.approx(float(quantiser_gain(1.0, 0.0, 0.1, 0.0)))
    assert few[0].real < 0.01
