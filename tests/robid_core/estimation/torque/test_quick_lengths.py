"""Lengths of recordings: a hundredth is left out at most, and only for transforms that take half as long."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.torque.quick_lengths import quick_length


def operations(length: int) -> int:
    """Of a transform by one prime factor after another, counted by dividing: no formula is shared."""
    total, left = 0, length
    for prime in range(2, length + 1):
        while left % prime == 0:
            total, left = total + length * prime, left // prime
    return total


def both(n_sample: int) -> int:
    """Operations of a recording and of its odd continuation."""
    return operations(n_sample) + operations(2 * (n_sample - 1))


@pytest.mark.parametrize("n_sample", [2479, 5300, 8003, 10007])
def test_a_large_prime_is_avoided(n_sample: int) -> None:
    kept = quick_length(n_sample)
    assert 0.99 * n_sample <= kept < n_sample
    assert both(kept) < 0.5 * both(n_sample)
    assert both(kept) == min(both(n) for n in range(int(np.ceil(0.99 * n_sample)), n_sample + 1))


@pytest.mark.parametrize("n_sample", [2, 3, 21, 1001, 6561])
def test_nothing_is_left_out_where_it_saves_less_than_half(n_sample: int) -> None:
    kept = quick_length(n_sample)
    shorter = range(max(2, int(np.ceil(0.99 * n_sample))), n_sample)
    assert (kept == n_sample) == all(both(n) >= 0.5 * both(n_sample) for n in shorter)


def test_of_a_very_long_recording_few_samples_are_left_out() -> None:
    assert 4_000_037 - 500 <= quick_length(4_000_037) <= 4_000_037
