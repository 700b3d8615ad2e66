"""Smoothing, differentiation, decimation and base parameters."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.errors import DataRejected
from robid_core.estimation.rigid.regression import (
    base_parameters,
    decimate,
    decimated_index,
    differentiate,
    smooth,
)

RATE = 1000.0


@pytest.mark.parametrize("order", [2, 4, 6])
def test_smoothing_halves_the_amplitude_at_the_cutoff_and_shifts_nothing(order: int) -> None:
    time = np.arange(4000) / RATE
    for f_hz, gain in (
        (100.0, 0.5),
        (10.0, 1 / (1 + (np.tan(np.pi * 0.01) / np.tan(np.pi * 0.1)) ** (2 * order))),
    ):
        # |H|^2 of a Butterworth filter made with the bilinear transform, twice -3 dB at its edge.
        wave = np.sin(2 * np.pi * f_hz * time)
        middle = slice(1000, 3000)  # 2 s: whole periods of both waves
        ratio = (smooth(wave, 1 / RATE, 100.0, order)[middle] @ np.exp(-2j * np.pi * f_hz * time[middle])) / (
            wave[middle] @ np.exp(-2j * np.pi * f_hz * time[middle])
        )
        assert ratio == pytest.approx(gain, abs=1e-6)


def test_smoothing_is_per_column() -> None:
    values = np.random.default_rng(0).normal(size=(300, 3))
    together = smooth(values, 1 / RATE, 50.0)
    for column in range(3):
        np.testing.assert_allclose(together[:, column], smooth(values[:, column], 1 / RATE, 50.0), atol=1e-12)


def test_a_cutoff_at_nyquist_and_a_short_signal_are_refused() -> None:
    with pytest.raises(DataRejected, match="above 1000 Hz, the data have 1000 Hz"):
        smooth(np.zeros(100), 1 / RATE, 500.0)
    with pytest.raises(DataRejected, match="12 samples are too few"):
        smooth(np.zeros(12), 1 / RATE, 50.0)


def test_central_differences_are_exact_for_a_parabola_inside() -> None:
    time = np.arange(50) * 0.01
    slope = differentiate(3 * time**2 - time, 0.01)
    np.testing.assert_allclose(slope[1:-1], (6 * time - 1)[1:-1], atol=1e-12)


@pytest.mark.parametrize("n_sample", [24792, 1000, 1001, 1009])
def test_decimation_keeps_the_samples_that_matlab_keeps(n_sample: int) -> None:
    # MATLAB: nout = ceil(n/r); nbeg = r - (r*nout - n); odata(nbeg:r:n), counted from one.
    n_out = -(-n_sample // 10)
    first = 10 - (10 * n_out - n_sample)
    np.testing.assert_array_equal(decimated_index(n_sample, 10), np.arange(first, n_sample + 1, 10) - 1)
    assert decimated_index(n_sample, 10)[-1] == n_sample - 1


def test_decimation_passes_slow_waves_and_stops_what_would_fold_back() -> None:
    time = np.arange(5000) / RATE
    index = decimated_index(5000, 10)
    slow = decimate(np.sin(2 * np.pi * 5 * time), 10)
    # Ripple of 0.05 dB, twice: at most 1.2 % below one.
    np.testing.assert_allclose(slow[20:-20], np.sin(2 * np.pi * 5 * time)[index][20:-20], atol=0.0125)
    fast = decimate(np.sin(2 * np.pi * 90 * time), 10)  # would appear at 10 Hz
    assert np.abs(fast[100:-100]).max() < 1e-5  # far from the ends, where the filters start


def test_decimation_by_one_changes_nothing() -> None:
    values = np.random.default_rng(0).normal(size=(7, 2))
    np.testing.assert_array_equal(decimate(values, 1), values)


def test_dependent_columns_are_grouped_into_the_first_of_their_set() -> None:
    draw = np.random.default_rng(6)
    x, y = draw.normal(size=(2, 100))
    base = base_parameters(np.column_stack([1e3 * x, np.zeros(100), y, 2 * x - 3 * y, 1e-3 * x]))
    assert base.independent.tolist() == [0, 2]
    assert base.dependent.tolist() == [3, 4]
    assert base.unseen.tolist() == [1]
    np.testing.assert_allclose(base.grouping, [[2e-3, 1e-6], [-3.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(base.values(np.array([1.0, 9.0, 1.0, 1.0, 1000.0])), [1.003, -2.0])
