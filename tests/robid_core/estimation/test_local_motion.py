"""Parabolas through recorded angles: exact where the motion is one, with the error that least squares promise."""

from __future__ import annotations

import numpy as np

from robid_core.estimation.local_motion import local_motion

T = 1e-3


def test_a_parabola_is_told_exactly_in_the_middle_and_at_both_ends() -> None:
    time = T * np.arange(40)
    position = (0.3 - 2.0 * time + 7.0 * time**2)[None, :, None]
    samples = [0, 1, 20, 39]
    angle, speed, acceleration = local_motion(position, samples, 4, T)
    np.testing.assert_allclose(angle[0, :, 0], position[0, samples, 0], atol=1e-12)
    # Rounding of 1e-16 over T (T^2), times some ten samples.
    np.testing.assert_allclose(speed[0, :, 0], -2.0 + 14.0 * time[samples], atol=1e-9)
    np.testing.assert_allclose(acceleration, 14.0, atol=1e-6)


def test_noise_leaves_in_the_speed_what_least_squares_promise() -> None:
    deviation, m = 1e-4, 6
    noise = deviation * np.random.default_rng(3).standard_normal((4000, 2 * m + 1, 1))
    speed = local_motion(noise, [m], m, T)[1]
    promised = deviation / (T * np.sqrt(m * (m + 1) * (2 * m + 1) / 3))
    # A standard deviation from 4000 values scatters by 1 / sqrt(8000) = 1.1 %: four of that.
    assert abs(speed.std() / promised - 1) < 0.045
