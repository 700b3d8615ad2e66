"""Intervals of relative errors hold the truth as often as they say, though neighbouring samples are alike."""

from __future__ import annotations

import numpy as np
import scipy

from robid_diagnosis.intervals import FEWEST, intervals, sums_of_blocks

N_TRIAL, N_LANE, N_SAMPLE, BLOCK = 400, 6, 2000, 250
DECAY = 0.95  # from one sample to the next: errors are alike for some twenty samples, a twelfth of a block


def alike(generator: np.random.Generator, size: float) -> np.ndarray:
    """Errors of first order with that rms, shape (N_LANE, N_SAMPLE, 1)."""
    white = size * np.sqrt(1 - DECAY**2) * generator.standard_normal((N_LANE, N_SAMPLE + 200, 1))
    return scipy.signal.lfilter([1.0], [1.0, -DECAY], white, axis=1)[:, 200:]


def test_intervals_of_errors_and_of_the_gain_cover_the_truth() -> None:
    """95 % asked; 400 trials tell the share to 1.1 %, and percentiles over 48 blocks are a little narrow."""
    generator = np.random.default_rng(7)
    held = np.zeros(3)
    for _ in range(N_TRIAL):
        measured = alike(generator, 1.0)
        error = np.stack([sums_of_blocks(alike(generator, size), BLOCK) for size in (0.3, 0.1)])
        found = intervals(error, sums_of_blocks(measured, BLOCK), generator)
        low, high = found.relative[:, :, 0]
        held[:2] += (low < [0.3, 0.1]) & (high > [0.3, 0.1])
        held[2] += found.gain[0] < 3.0 < found.gain[1]
    assert (held / N_TRIAL >= 0.90).all(), held / N_TRIAL
    assert (held / N_TRIAL <= 0.98).all(), held / N_TRIAL


def test_sums_of_blocks_lose_nothing() -> None:
    values = np.random.default_rng(1).standard_normal((3, 1030, 2))
    sums = sums_of_blocks(values, 100)
    assert sums.shape == (3 * 10, 2)
    np.testing.assert_allclose(sums.sum(axis=0), (values**2).sum(axis=(0, 1)))
    np.testing.assert_allclose(sums[0], (values[0, :100] ** 2).sum(axis=0))
    assert sums_of_blocks(values, 5000).shape == (3, 2)


def test_few_blocks_have_no_interval() -> None:
    error, power = np.ones((1, FEWEST - 1, 2)), np.ones((FEWEST - 1, 2))
    found = intervals(error, power, np.random.default_rng(1))
    assert np.isnan(found.relative).all()
    assert np.isnan(found.gain).all()
