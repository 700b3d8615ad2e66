"""Noise of angles as a spectrum shows it: white noise and encoder steps are seen, motion is not taken for them."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.torque.shown_noise import shown_noise

T, N = 1e-3, 8000
TIME = T * np.arange(N)


def motion(seed: int, step: float = 100.0) -> np.ndarray:
    """A large slow motion with waves up to 80 Hz, and the corners that steps of friction make, rad/s^2."""
    generator = np.random.default_rng(seed)
    waves = [
        np.sin(2 * np.pi * f * TIME + generator.uniform(0, 6)) * 5 / f for f in generator.uniform(1, 80, 30)
    ]
    angle = 40 * np.sin(2 * np.pi * 0.3 * TIME + seed) + np.sum(waves, axis=0)
    steps = np.repeat(np.where(np.arange(N // 100) % 2, 1.0, -1.0) * step, 100)
    corners: np.ndarray = angle + np.cumsum(np.cumsum(steps - steps.mean())) * T**2
    return corners[None, None, :, None]


@pytest.mark.parametrize("deviation", [1e-4, 1e-5])
def test_white_noise_is_found_behind_a_large_motion(deviation: float) -> None:
    """400 bins of two experiments tell a variance to 5 %, a deviation to 3 %."""
    generator = np.random.default_rng(5)
    angle = np.concatenate([motion(k) + deviation * generator.standard_normal((1, 1, N, 1)) for k in (1, 2)])
    assert np.sqrt(shown_noise(angle, T, 100.0)[0]) == pytest.approx(deviation, rel=0.1)


def test_steps_of_an_encoder_are_noise_of_their_size() -> None:
    step = 2 * np.pi / 8192
    angle = step * np.round(motion(3) / step)
    assert np.sqrt(shown_noise(angle, T, 100.0)[0]) == pytest.approx(step / np.sqrt(12), rel=0.1)


def test_motion_alone_is_no_noise() -> None:
    """The spectrum of corners falls with the cube; of a smooth motion only rounding is left."""
    assert shown_noise(motion(4, 600.0), T, 100.0)[0] == 0
    smooth = 40 * np.sin(2 * np.pi * 0.3 * TIME)[None, None, :, None]
    assert np.sqrt(shown_noise(smooth, T, 100.0)[0]) < 1e-11


def test_a_band_that_reaches_near_half_the_sampling_rate_shows_none() -> None:
    angle = motion(6) + 1e-3 * np.random.default_rng(7).standard_normal((1, 1, N, 1))
    assert shown_noise(angle, T, 100.0)[0] > 0
    assert shown_noise(angle, T, 300.0)[0] == 0
    assert shown_noise(angle[:, :, :8], T, 100.0)[0] == 0
