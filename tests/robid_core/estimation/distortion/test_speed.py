"""The motion under which a response was measured, from synthetic motor angles."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FloatArray
from robid_core.estimation.distortion.speed import slow_sine_bin, speed_levels

N, STEP = 1000, 0.002  # a period of 2 s
LINE = np.array([9, 15, 33, 61])


def position(sine: float, sine_bin: int, speed: float, generator: np.random.Generator) -> FloatArray:
    """Two experiments of three periods and two axes: cosines of equal speed at the lines, and a sine."""
    time = np.arange(N) / N
    omega = 2 * np.pi * LINE / (N * STEP)
    phase = generator.uniform(0, 2 * np.pi, (2, 1, 1, 2, len(LINE)))
    fast = (speed / omega * np.cos(2 * np.pi * LINE * time[:, None, None] + phase)).sum(axis=-1)
    slow = sine / (2 * np.pi * max(sine_bin, 1) / 2.0) * np.cos(2 * np.pi * sine_bin * time + 0.3)
    return np.broadcast_to(fast + slow[:, None], (2, 3, N, 2))


@pytest.mark.parametrize("sine_bin", [2, 4])
def test_speed_of_multisine_and_sine_are_told_apart(sine_bin: int) -> None:
    rms, amplitude = speed_levels(position(7.0, sine_bin, 1.5, np.random.default_rng(1)), LINE, STEP)
    assert amplitude == pytest.approx([7.0, 7.0])
    assert rms == pytest.approx(np.full(2, 1.5 * np.sqrt(len(LINE) / 2)))


def test_without_a_sine_none_is_found() -> None:
    generator = np.random.default_rng(2)
    motion = position(0.0, 2, 1.5, generator)
    # Distortion below the band, on several bins.
    time = np.arange(N) / N
    motion = motion + sum(0.02 * np.cos(2 * np.pi * k * time + k)[:, None] for k in (2, 4, 6))
    _, amplitude = speed_levels(motion, LINE, STEP)
    assert amplitude.tolist() == [0.0, 0.0]


def test_noise_of_the_sensor_counts_only_up_to_twice_the_band() -> None:
    generator = np.random.default_rng(3)
    noise = 1e-3 * generator.standard_normal((40, 1, N, 1))
    rms, _ = speed_levels(noise, LINE, STEP)
    # White noise of variance s^2 has 2 s^2 / N on each bin, times w^2, up to bin 122: sum of k^2 = 122^3 / 3.
    omega_1 = 2 * np.pi / (N * STEP)
    expected = 1e-3 * omega_1 * np.sqrt(2 / N * 122 * 123 * 245 / 6)
    assert rms[0] == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    ("power", "found"),
    [
        ([9.0, 0.0, 5.0, 0.1, 0.0, 3.0, 3.0], 2),
        ([9.0, 0.0, 0.2, 0.1, 0.1, 3.0, 3.0], 0),  # too weak beside the multisine
        ([9.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0], 0),  # nothing stands out
    ],
)
def test_the_slow_sine_has_to_stand_out(power: list[float], found: int) -> None:
    assert slow_sine_bin(np.array(power), 5) == found
    assert slow_sine_bin(np.array(power), 1) == 0  # no bin below the band
