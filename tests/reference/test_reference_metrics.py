"""The metric of error and the rule of coverage, on data of known distribution."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from reference.metrics import (
    bias_and_scatter,
    bootstrap_interval,
    covered,
    interval_covers,
    lines_apart,
    log_error,
    region_factor,
    rms_log_error,
    rms_relative_error,
    seen_entries,
    share,
)
from scipy import stats

ComplexArray = npt.NDArray[np.complex128]


def complex_gaussian(shape: tuple[int, ...], seed: int) -> ComplexArray:
    """Circular complex Gaussian numbers of variance 1 (real and imaginary part together)."""
    generator = np.random.default_rng(seed)
    parts = generator.standard_normal((2, *shape)) / np.sqrt(2)
    result: ComplexArray = parts[0] + 1j * parts[1]
    return result


def test_an_error_of_a_percent_and_of_a_hundredth_of_a_radian_count_alike() -> None:
    truth = complex_gaussian((5, 2, 2), 0)
    everything = np.ones(truth.shape, dtype=bool)
    assert rms_log_error(truth * np.exp(0.01), truth, everything) == pytest.approx(0.01)
    assert rms_log_error(truth * np.exp(0.01j), truth, everything) == pytest.approx(0.01)
    assert rms_log_error(truth * np.exp(0.03 + 0.04j), truth, everything) == pytest.approx(0.05)


def test_a_phase_error_is_counted_the_short_way_round() -> None:
    assert log_error(np.array([np.exp(3.1j)]), np.array([np.exp(-3.1j)])) == pytest.approx(
        1j * (6.2 - 2 * np.pi)
    )


def test_entries_that_are_not_seen_do_not_count_and_lost_ones_count_infinitely() -> None:
    truth = np.ones((3, 2, 2), dtype=complex)
    seen = np.ones((3, 2, 2), dtype=bool)
    seen[1] = False
    estimate = np.stack([truth, truth])
    estimate[:, 1] = 0
    assert rms_log_error(estimate, truth, seen) == 0
    for lost in (0, np.nan, np.inf):
        estimate[1, 2, 0, 0] = lost
        assert rms_log_error(estimate, truth, seen) == np.inf


def test_ten_decibels_are_a_factor_of_ten_in_power() -> None:
    response = np.array([1.0, 1.0j])
    assert seen_entries(response, np.array([0.0999, 0.1001])).tolist() == [True, False]


def test_bias_and_scatter_are_told_apart() -> None:
    truth = np.full((200, 6, 6), 2.0 - 1.0j)
    everything = np.ones(truth.shape, dtype=bool)
    noise = complex_gaussian((10, *truth.shape), 1)
    bias, scatter = bias_and_scatter(truth * np.exp(0.02 + 0.05 * noise), truth, everything)
    # 7200 entries: the mean square of 10 runs' mean has a deviation of 0.05^2 / 10 / sqrt(7200), and twice the
    # product of bias and mean error adds 2 * 0.02 * 0.05 / sqrt(2 * 72000) to it; 5 deviations of the bias: 4 %.
    assert bias == pytest.approx(0.02, rel=0.04)
    assert scatter == pytest.approx(0.05, rel=5 / (2 * np.sqrt(7200 * 9)))
    without, _ = bias_and_scatter(truth * np.exp(0.05 * noise), truth, everything)
    assert without < 0.05 * np.sqrt(5 / (10 * np.sqrt(7200)))


def test_relative_errors_are_averaged_as_squares() -> None:
    truth = np.array([[10.0, 200.0]])
    assert rms_relative_error(np.array([[10.3, 192.0]]), truth) == pytest.approx(0.01 * np.sqrt((9 + 16) / 2))


def test_region_factor_is_that_of_four_blocks_and_of_many() -> None:
    assert region_factor(3) == pytest.approx(3 * (0.05 ** (-1 / 3) - 1))  # closed form of F(2, 2 nu)
    assert region_factor(3) == pytest.approx(5.14, abs=0.005)
    assert region_factor(np.inf) == pytest.approx(-np.log(0.05))
    assert region_factor(1e6) == pytest.approx(3.00, abs=0.005)


@pytest.mark.parametrize("blocks", [2, 4, 24])
def test_regions_from_few_blocks_cover_as_often_as_they_say(blocks: int) -> None:
    data = complex_gaussian((20_000, blocks), blocks)
    estimate, variance = data.mean(axis=1), data.var(axis=1, ddof=1) / blocks
    hits = covered(estimate, np.zeros((), dtype=complex), variance, blocks - 1)
    result = share(hits, level=1 - 1e-5)
    assert result.lower < 0.95 < result.upper
    if blocks == 4:  # chi-square says 3.00 where F(2, 6) says 5.14
        wrong = share(covered(estimate, np.zeros((), dtype=complex), variance, np.inf), level=1 - 1e-5)
        # |e|^2 / variance of 4 blocks is above 3 with probability (1 + 3 / 3)^-3 = 1 / 8.
        assert wrong.lower < 7 / 8 < wrong.upper


def test_uncertainty_of_the_truth_widens_the_region() -> None:
    error, truth = complex_gaussian((20_000,), 3), 0.5 * complex_gaussian((20_000,), 4)
    hits = covered(error, truth, np.ones(20_000), np.inf, truth_variance=0.25)
    result = share(hits, level=1 - 1e-5)
    assert result.lower < 0.95 < result.upper
    assert covered(error, truth, np.ones(20_000), np.inf).mean() < result.lower


def test_intervals_of_real_parameters_cover_as_often_as_they_say() -> None:
    error = np.random.default_rng(0).standard_normal(20_000)
    result = share(interval_covers(5 + 2 * error, np.full(20_000, 5.0), np.full(20_000, 2.0)), level=1 - 1e-5)
    assert result.lower < 0.95 < result.upper


@pytest.mark.parametrize("hits, trials", [(0, 10), (3, 10), (95, 100), (100, 100)])
def test_wilson_interval_solves_its_equation(hits: int, trials: int) -> None:
    result = share(np.arange(trials) < hits)
    z = stats.norm.ppf(0.975)
    for bound in (result.lower, result.upper):
        # Shares p of which the observed one is z standard deviations away: |k/n - p| = z sqrt(p (1 - p) / n).
        if 1e-12 < bound < 1 - 1e-12:
            distance = abs(hits / trials - bound)
            assert distance == pytest.approx(z * np.sqrt(bound * (1 - bound) / trials), rel=1e-9)
    assert result.lower <= result.value == hits / trials <= result.upper


def test_a_share_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="no trials"):
        share(np.zeros((0,), dtype=bool))


def test_lines_apart_share_no_window() -> None:
    chosen = lines_apart(100, 41)
    assert chosen.tolist() == [8, 49, 90]
    assert np.array_equal(lines_apart(5, 1), np.arange(5))
    for n_freq, window in ((100, 7), (30, 31), (10, 10)):
        chosen = lines_apart(n_freq, window)
        assert len(chosen) == -(-n_freq // window)
        assert (np.diff(chosen) == window).all()
        assert chosen[-1] < n_freq


def test_bootstrap_interval_of_a_mean_is_as_wide_as_its_standard_error_says() -> None:
    generator = np.random.default_rng(0)
    values = generator.standard_normal((400, 3))
    lower, upper = bootstrap_interval(values, lambda v: float(v.mean()), generator)
    assert lower < values.mean() < upper
    # Half width 1.96 / sqrt(1200); quantiles of 1000 draws and the sample's own deviation are good to 10 %.
    assert (upper - lower) / 2 == pytest.approx(1.96 / np.sqrt(1200), rel=0.2)
