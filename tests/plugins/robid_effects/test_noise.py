"""Noise: variance, spectrum and stationarity against their theory."""

import numpy as np
import pytest
from scipy.stats import chi2

from robid_core import Motion
from robid_effects.noise import ColouredNoise, WhiteNoise

RARE = 1e-6  # each bound of a test is missed by chance once in a million


def test_white_noise_has_its_variance_and_no_memory(at) -> None:
    n = 100_000
    noise = WhiteNoise.draw(np.array([2.0]), at("position"), (1, n), np.random.default_rng(11))[0]
    lower, upper = chi2.ppf([RARE, 1 - RARE], n)
    assert lower < (noise / 2) @ (noise / 2) < upper
    assert (noise[1:] @ noise[:-1]) / 4 / n == pytest.approx(0, abs=5 / np.sqrt(n))


def test_the_spectrum_of_coloured_noise_is_that_of_the_theory(at) -> None:
    """64 lanes of 256 samples: at each line the sum of periodograms over its mean is chi-square of 128.

    The mean of a periodogram follows exactly from the autocovariance r^|k| through the triangle window; it is
    the spectrum but for leakage of the order 1 / n.
    """
    lanes, n, rms, time = 64, 256, 0.3, 4e-3
    noise = ColouredNoise.draw(np.array([rms, time]), at("position"), (lanes, n), np.random.default_rng(12))
    r, lag = np.exp(-1e-3 / time), np.arange(n)
    covariance = rms**2 * r**lag * (1 - lag / n)
    mean = 2 * np.fft.rfft(covariance).real - covariance[0]
    w = 2 * np.pi * np.arange(n // 2 + 1) / n
    spectrum = rms**2 * (1 - r**2) / np.abs(1 - r * np.exp(-1j * w)) ** 2
    np.testing.assert_allclose(
        mean, spectrum, rtol=0.1
    )  # leakage, 2 r / (1 - r^2) / n of the largest at most
    power = (np.abs(np.fft.rfft(noise)) ** 2 / n).sum(axis=0)[1:-1] / mean[1:-1]
    lower, upper = chi2.ppf([RARE / n, 1 - RARE / n], 2 * lanes)
    assert (lower < 2 * power).all()
    assert (2 * power < upper).all()


def test_coloured_noise_is_stationary_from_its_first_sample(at) -> None:
    lanes = 20_000
    noise = (
        ColouredNoise.draw(np.array([0.3, 0.05]), at("position"), (lanes, 3), np.random.default_rng(13)) / 0.3
    )
    lower, upper = chi2.ppf([RARE, 1 - RARE], lanes)
    for k in range(3):
        assert lower < noise[:, k] @ noise[:, k] < upper
    r = np.exp(-1e-3 / 0.05)
    error = np.sqrt((1 - r**2) ** 2 / lanes)  # of the correlation of two Gaussian numbers
    assert np.corrcoef(noise[:, 0], noise[:, 1])[0, 1] == pytest.approx(r, abs=5 * error)


def test_without_correlation_time_coloured_noise_is_white(at) -> None:
    draws = [
        effect.draw(np.array(parameters), at("position"), (2, 5), np.random.default_rng(14))
        for effect, parameters in ((WhiteNoise, [0.3]), (ColouredNoise, [0.3, 0.0]))
    ]
    np.testing.assert_array_equal(*draws)


def test_the_same_generator_gives_the_same_noise_and_another_lane_another(at) -> None:
    first, again = (
        ColouredNoise.draw(np.array([1.0, 0.01]), at("position"), (2, 50), np.random.default_rng(15))
        for _ in range(2)
    )
    np.testing.assert_array_equal(first, again)
    assert np.abs(first[0] - first[1]).max() > 0.1


def test_law_and_gain_leave_the_signal_alone(at, through) -> None:
    signal = np.array([0.3, -2.0])
    for effect in (WhiteNoise, ColouredNoise):
        np.testing.assert_array_equal(through(effect, signal, at("position")), signal)
        assert (effect.gain(effect.defaults(), at("position"), np.ones(3), Motion()) == 1).all()
