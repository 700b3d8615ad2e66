"""Segments, windows and correlations of Welch's method, against scipy.signal and against plain matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import signal

from robid_core import ConfigurationError, PoorExcitation
from robid_core.estimation.response.instrumental import instrumental_response, multiple_coherence
from robid_core.estimation.response.welch import (
    Correlation,
    bands,
    difference_correction,
    equivalent_bins,
    equivalent_segments,
    overlap_correlation,
    pooled_freedom,
    refuse_few_segments,
    second_difference,
    segment_spectra,
    segmentation,
    speed_rms,
    window_samples,
    without_trend,
)


def noise_and_response(n_sample: int = 4000) -> tuple[Any, Any]:
    generator = np.random.default_rng(1)
    u = generator.standard_normal((n_sample, 1))
    y = signal.lfilter([0.3, 0.2], [1, -1.2, 0.5], u, axis=0) + 0.2 * generator.standard_normal((n_sample, 1))
    return u, y


@pytest.mark.parametrize("degree, name", [(None, False), (0, "constant"), (1, "linear")])
def test_response_and_coherence_of_one_axis_are_those_of_scipy(degree: int | None, name: Any) -> None:
    # The same sums in another order: a few hundred terms of relative error 1e-16, divided by windows' sums.
    u, y = noise_and_response()
    cut = segmentation(len(u), 250, 0.6, "hann", circular=False)
    bins = np.arange(1, 120)
    uu, yy = (segment_spectra(x, cut, bins, degree) for x in (u, y))
    options: dict[str, Any] = {"window": "hann", "nperseg": 250, "noverlap": 150, "detrend": name}
    cross, own = signal.csd(u[:, 0], y[:, 0], **options)[1], signal.welch(u[:, 0], **options)[1]
    coherence = signal.coherence(u[:, 0], y[:, 0], **options)[1]
    response = instrumental_response(uu, yy, None).response[:, 0, 0]
    np.testing.assert_allclose(response, (cross / own)[bins], rtol=1e-10)
    np.testing.assert_allclose(multiple_coherence(uu, yy)[:, 0], coherence[bins], rtol=1e-10)


def test_a_cosine_on_a_bin_has_half_its_amplitude_under_any_window() -> None:
    n = np.arange(1000)
    x = 3.0 * np.cos(2 * np.pi * 7 * n / 200)[:, None]
    for window in ("hann", "rectangular"):
        cut = segmentation(1000, 200, 0.5, window, circular=False)
        spectrum = segment_spectra(x, cut, np.array([7]))
        np.testing.assert_allclose(np.abs(spectrum), 1.5, rtol=1e-12)


def test_mean_and_straight_line_are_removed_from_every_segment() -> None:
    t = np.arange(600.0)[:, None]
    line = np.concatenate([5.0 - 0.02 * t, 1.0 + 0.3 * t], axis=1)
    cut = segmentation(600, 100, 0.5, "rectangular", circular=False)
    assert np.abs(segment_spectra(line, cut, np.arange(50), degree=1)).max() < 1e-12 * np.abs(line).max()
    segments = without_trend(line[None], 0)
    np.testing.assert_allclose(segments.mean(axis=1), 0, atol=1e-10)
    assert np.abs(segments).max() > 1  # the slope is still there


STEP = 0.002


def test_acceleration_of_a_steady_period_is_exact() -> None:
    n, k = np.arange(500), np.array([3, 40, 200])
    position = np.cos(2 * np.pi * k * n[:, None] / 500 + np.array([0.1, 0.2, 0.3]))
    difference = second_difference(position, STEP, closed=True)
    frequency = k / (500 * STEP)
    spectrum = np.fft.rfft(difference, axis=0)[k, range(3)] * difference_correction(frequency, STEP) / 500
    expected = -((2 * np.pi * frequency) ** 2) * 0.5 * np.exp(1j * np.array([0.1, 0.2, 0.3]))
    # The difference of three numbers of size 1 that leaves (w T)^2 = 1.4e-3 of them at bin 3.
    np.testing.assert_allclose(spectrum, expected, rtol=1e-12)


def test_windowed_acceleration_survives_a_strong_slow_motion_and_windowed_position_does_not() -> None:
    # A slow sine of 1 rad at 0.7 Hz between bins beside 1e-4 rad at 30.3 Hz, between bins too. The exact answer is
    # the window over the analytic acceleration; what the correction takes at the bin and not at the sine is
    # a relative |c(f0) / c(bin) - 1| of each part's share.
    t = np.arange(2000) * STEP
    parts = [(1.0, 0.7), (1e-4, 30.3)]
    position = sum(a * np.cos(2 * np.pi * f * t + 1) for a, f in parts)[:, None]
    exact = sum(-a * (2 * np.pi * f) ** 2 * np.cos(2 * np.pi * f * t + 1) for a, f in parts)[:, None]
    inner = segmentation(1998, 500, 0.5, "hann", circular=False)
    bins = np.arange(28, 34)
    frequency = bins / (500 * STEP)
    correction = difference_correction(frequency, STEP)
    estimate = (
        segment_spectra(second_difference(position, STEP, closed=False), inner, bins)
        * correction[:, None, None]
    )
    wanted = segment_spectra(exact[1:-1], inner, bins)
    share = [
        segment_spectra((a * (2 * np.pi * f) ** 2 * np.cos(2 * np.pi * f * t + 1))[1:-1, None], inner, bins)
        for a, f in parts
    ]
    bound = sum(
        np.abs(s) * np.abs(correction / difference_correction(np.array([f]), STEP) - 1)[:, None, None]
        for s, (_, f) in zip(share, parts, strict=True)
    )
    assert (np.abs(estimate - wanted) <= bound + 1e-9 * np.abs(wanted).max()).all()
    naive = -((2 * np.pi * frequency) ** 2)[:, None, None] * segment_spectra(position[1:-1], inner, bins)
    assert np.abs(naive - wanted).max() > 10 * np.abs(estimate - wanted).max()


def dense(cut: Any, bins: Any) -> Any:
    """Gamma by definition: columns (segment, bin) as linear forms of white samples, their products."""
    length, rows = len(cut.window), []
    for start in cut.start:
        for k in bins:
            row = np.zeros(cut.n_sample, dtype=complex)
            index = (start + np.arange(length)) % cut.n_sample
            row[index] = cut.window * np.exp(-2j * np.pi * k * np.arange(length) / length)
            rows.append(row)
    forms = np.array(rows)
    return forms @ forms.conj().T / np.sum(cut.window**2)


@settings(max_examples=30, deadline=None)
@given(
    length=st.integers(8, 30),
    overlap=st.sampled_from([0.0, 0.3, 0.5, 0.75]),
    window=st.sampled_from(["hann", "rectangular"]),
    n_bin=st.integers(1, 3),
    seed=st.integers(0, 100),
)
def test_correlation_of_overlapping_segments_is_that_of_their_samples(
    length: int, overlap: float, window: str, n_bin: int, seed: int
) -> None:
    cut = segmentation(100, length, overlap, window, circular=False)
    bins = np.array([np.arange(1, 1 + n_bin), np.arange(2, 2 + n_bin)])
    related = Correlation(cut, bins, np.full((2, len(cut.start)), True))
    generator = np.random.default_rng(seed)
    x = generator.standard_normal((2, 3, 2 * len(cut.start) * n_bin, 2)) @ np.array([1, 1j])
    result = related.correlate(x)
    for line in range(2):
        gamma = dense(cut, bins[line])
        expected = x[line].reshape(3, 2, -1) @ gamma.conj()
        np.testing.assert_allclose(result[line], expected.reshape(3, -1), atol=1e-11)
        trace, square = related.traces()
        assert trace == pytest.approx(2 * np.trace(gamma).real)
        assert square == pytest.approx(2 * np.trace(gamma @ gamma).real)


def test_segments_that_go_round_a_period_are_correlated_across_its_end() -> None:
    cut = segmentation(120, 40, 0.5, "hann", circular=True)
    assert len(cut.start) == 6
    bins = np.array([[3, 4]])
    related = Correlation(cut, bins, np.full((1, 6), True))
    x = np.random.default_rng(0).standard_normal((1, 2, 12)).astype(complex)
    gamma = dense(cut, bins[0])
    np.testing.assert_allclose(related.correlate(x)[0], x[0] @ gamma.conj(), atol=1e-12)
    assert abs(gamma[0, 10]) == pytest.approx(1 / 6)  # the first segment and the last
    assert related.traces()[1] == pytest.approx(np.trace(gamma @ gamma).real)


def test_segments_that_are_left_out_count_for_nothing() -> None:
    cut = segmentation(100, 20, 0.5, "hann", circular=False)
    kept = np.full((1, len(cut.start)), True)
    kept[0, [2, 5]] = False
    related = Correlation(cut, np.array([[4]]), kept)
    gamma = dense(cut, [4])[np.ix_(kept[0], kept[0])]
    assert related.traces() == pytest.approx((np.trace(gamma).real, np.trace(gamma @ gamma).real))
    x = np.ones((1, 1, len(cut.start)), dtype=complex) * kept
    np.testing.assert_allclose(related.correlate(x)[0][:, kept[0]], np.ones((1, kept.sum())) @ gamma.conj())


def test_hann_windows_are_correlated_as_the_books_say() -> None:
    hann = window_samples("hann", 512)
    # Welch (1967): (1/6)^2 at half overlap in power; Harris (1978): 0.167 at 50 %, 0.659 at 75 %.
    assert overlap_correlation(hann, 256, np.array([0]))[0].real == pytest.approx(1 / 6)
    assert overlap_correlation(hann, 128, np.array([0]))[0].real == pytest.approx(0.659, abs=5e-4)
    # Fourier coefficients of Hann's window squared: 3/8, 1/4, 1/16.
    np.testing.assert_allclose(overlap_correlation(hann, 0, np.arange(4)), [1, -2 / 3, 1 / 6, 0], atol=1e-12)
    n = 9
    cut = segmentation(512 * (n + 1) // 2, 512, 0.5, "hann", circular=False)
    assert len(cut.start) == n
    assert equivalent_segments(cut) == pytest.approx(n / (1 + 2 * (1 - 1 / n) / 36))  # Welch (1967), eq. 12


def test_neighbouring_bins_of_a_hann_window_are_worth_half() -> None:
    hann = window_samples("hann", 512)
    # n^2 / (n + 2 (n - 1) 4/9 + 2 (n - 2) / 36) -> n / (1 + 8/9 + 1/18) = 0.514 n.
    assert equivalent_bins(hann, np.arange(10, 410)) / 400 == pytest.approx(18 / 35, rel=0.01)
    assert equivalent_bins(hann, np.array([10, 13, 20])) == pytest.approx(3)
    assert equivalent_bins(window_samples("rectangular", 512), np.arange(5)) == pytest.approx(5)


def test_shared_covariances_count_each_neighbour_for_what_it_adds() -> None:
    freedom, valid = np.full((1, 6), 4.0), np.array([[True, True, False, True, True, True]])
    groups = [np.array([k]) for k in range(10, 16)]
    alone = pooled_freedom(freedom, valid, 1, groups, None)
    np.testing.assert_allclose(alone, [[12, 12, 0, 12, 12, 12]])
    shared = pooled_freedom(freedom, valid, 1, groups, window_samples("hann", 64))
    # Bins 13 to 15: 9 / (3 + 4 * 4/9 + 2 / 36) = 1.862 of a line's own four.
    assert shared[0, 4] == pytest.approx(4 * 9 / (3 + 16 / 9 + 1 / 18))
    assert (pooled_freedom(freedom, valid, 0, groups, window_samples("hann", 64)) == freedom * valid).all()


@settings(max_examples=50, deadline=None)
@given(first=st.integers(1, 40), count=st.integers(1, 200), lines=st.integers(1, 60))
def test_every_bin_between_the_targets_belongs_to_one_line(first: int, count: int, lines: int) -> None:
    bins = np.arange(first, first + count)
    targets = np.unique(np.geomspace(bins[0], bins[-1], lines)) * 0.5
    groups, frequency = bands(bins, 0.5, targets)
    np.testing.assert_array_equal(np.concatenate(groups), bins)
    assert (np.diff(frequency) > 0).all()
    np.testing.assert_allclose(frequency, [0.5 * group.mean() for group in groups])


def test_speed_below_a_frequency_leaves_the_rest_out() -> None:
    # The ends of the recording make a sine leak: A / (2 pi d) at d bins from it. The fast one is 3000 to 4000 bins
    # from the band: a mean square of at most 2 (A / 2 pi)^2 (1/3000 - 1/4000) = (2.1e-3 A)^2, from both its sides
    # at most 3e-3 A. The slow one loses what leaks out of the band, less than 1 %.
    t = np.arange(20000) * 0.001
    position = np.stack([np.sin(2 * np.pi * 5 * t) / (10 * np.pi), np.sin(2 * np.pi * 200 * t)], axis=1)
    rms = speed_rms(position, np.full(20000, True), 0.001, 50.0)
    assert rms[0] == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert rms[1] < 3e-3 * 2 * np.pi * 200


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="does not fit into a recording of 100 samples"):
        segmentation(100, 101, 0.5, "hann", circular=False)
    with pytest.raises(ConfigurationError, match="whole periods"):
        segmentation(100, 60, 0.5, "hann", circular=True)
    with pytest.raises(ConfigurationError, match="neither hann nor rectangular"):
        window_samples("kaiser", 10)
    with pytest.raises(ConfigurationError, match="increase"):
        bands(np.arange(3, 9), 1.0, np.array([4.0, 3.0]))
    with pytest.raises(PoorExcitation, match="configuration 2: 5 independent .* cannot separate 6 axes"):
        refuse_few_segments(5.0, 6, "configuration 2")
