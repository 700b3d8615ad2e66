"""Lines of the excitation: how many, which, and which are left out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from robid_core.errors import ConfigurationError
from robid_core.estimation.excitation import grids

BANDS = {"low": st.floats(0.5, 20), "ratio": st.floats(1.5, 60), "period": st.floats(1, 25)}


@given(**BANDS, share=st.floats(0, 1))
@settings(max_examples=200, deadline=None)
def test_lines_are_exactly_as_many_as_asked_distinct_odd_and_in_the_band(
    low: float, ratio: float, period: float, share: float
) -> None:
    band = (low, low * ratio)
    room = len(grids.odd_bins(band, period))
    count = int(share * room)
    assume(count >= 2)
    line = grids.logarithmic_odd_lines(band, count, period)
    assert len(line) == count
    assert (np.diff(line) > 0).all()
    assert (line % 2 == 1).all()
    assert line[0] >= band[0] * period - 1e-6
    assert line[-1] <= band[1] * period + 1e-6
    # The ends of the band are used: no further odd bin would fit outside.
    assert line[0] - 2 < band[0] * period
    assert line[-1] + 2 > band[1] * period
    # Logarithmic: spacing never falls from one pair to the next by more than the rounding to odd bins.
    assert (np.diff(np.diff(line)) >= -2).all()


@given(**BANDS, share=st.floats(0, 1), sine_bin=st.sampled_from([0, 3, 5, 7]))
@settings(max_examples=200, deadline=None)
def test_every_grid_is_a_choice_without_doubles(
    low: float, ratio: float, period: float, share: float, sine_bin: int
) -> None:
    bins = grids.odd_bins((low, low * ratio), period)
    if sine_bin:
        bins = grids.without_multiples(bins, sine_bin)
        assert (bins % sine_bin != 0).all()
    count = int(share * len(bins))
    assume(count >= 1)
    for choice in (grids.linear_choice, grids.logarithmic_choice):
        line = choice(bins, count)
        assert len(line) == count
        assert (np.diff(line) > 0).all()
        assert np.isin(line, bins).all()
        if count > 1:
            assert line[[0, -1]].tolist() == bins[[0, -1]].tolist()
    if not sine_bin and count > 1:
        # Odd neighbours are 2 apart: rounding moves a line by at most one bin.
        distance = grids.linear_choice(bins, count) - np.linspace(bins[0], bins[-1], count)
        assert np.abs(distance).max() <= 1 + 1e-9


def test_only_odd_multiples_of_the_sine_are_missing() -> None:
    bins = np.arange(1, 60, 2)
    assert grids.without_multiples(bins, 5).tolist() == [k for k in range(1, 60, 2) if k % 5]
    assert len(grids.without_multiples(bins, 1)) == 0


def test_a_logarithmic_grid_stays_one_where_multiples_are_missing() -> None:
    bins = grids.without_multiples(grids.odd_bins((4.0, 80.0), 40.0), 3)
    line = grids.logarithmic_choice(bins, 20)
    # Every third odd bin is missing: bins are 2 or 4 apart, 3 in the mean. A place counted in the mean is off by at
    # most one bin from the true one and rounding by half of 4.
    assert np.abs(line - np.geomspace(bins[0], bins[-1], 20)).max() <= 3.0


def test_the_worked_example_gets_its_hundred_lines() -> None:
    line = grids.logarithmic_odd_lines((4.0, 80.0), 100, 8.0)
    assert len(np.unique(line)) == 100
    # Rounding a plain logarithmic grid loses lines, which is why the function is not that.
    plain = 2 * np.round((np.geomspace(33, 639, 100) - 1) / 2) + 1
    assert len(np.unique(plain)) < 100


def test_a_wide_grid_is_logarithmic_up_to_its_rounding() -> None:
    line = grids.logarithmic_odd_lines((4.0, 80.0), 20, 40.0)
    # Odd bins are two apart, so that rounding moves a line by at most one bin.
    assert np.abs(line - np.geomspace(161, 3199, 20)).max() <= 1.0


def test_one_line_is_the_middle_one() -> None:
    bins = np.array([3, 5, 7, 9, 11])
    assert grids.linear_choice(bins, 1).tolist() == [7]
    assert grids.logarithmic_choice(bins, 1).tolist() == [5]  # sqrt(33) = 5.7


def test_a_band_without_enough_bins_is_refused_with_what_would_do() -> None:
    with pytest.raises(ConfigurationError, match="at most 152 lines, or for a period of about 5.2"):
        grids.logarithmic_odd_lines((4.0, 80.0), 200, 4.0)
    assert len(grids.logarithmic_odd_lines((4.0, 80.0), 200, 5.3)) == 200
    assert len(grids.logarithmic_odd_lines((4.0, 80.0), 152, 4.0)) == 152
    assert grids.logarithmic_odd_lines((4.0, 80.0), 1, 8.0).tolist() == [145]  # sqrt(33 * 639) = 145.2
    with pytest.raises(
        ConfigurationError, match="leaves 0 odd bins from 4 to 4.1 Hz; .* period of about 20 s"
    ):
        grids.logarithmic_odd_lines((4.0, 4.1), 1, 2.0)
    # One of every four is left out beside them: 152 bins hold 38 of these and 114 lines.
    bins = grids.odd_bins((4.0, 80.0), 4.0)
    grids.refuse_too_few(bins, 114, (4.0, 80.0), 4.0, group=4)
    with pytest.raises(ConfigurationError, match="ask for at most 114 lines"):
        grids.refuse_too_few(bins, 115, (4.0, 80.0), 4.0, group=4)


@given(count=st.integers(1, 300), group=st.integers(2, 12), seed=st.integers(0, 99))
@settings(max_examples=200, deadline=None)
def test_one_line_of_each_group_is_left_out_and_the_count_is_exact(count: int, group: int, seed: int) -> None:
    line = 3 + 2 * np.arange(grids.with_detection(count, group)) ** 2
    excited, detection = grids.leave_one_out(line, group, np.random.default_rng(seed))
    assert len(excited) == count
    assert np.array_equal(np.sort(np.concatenate([excited, detection])), line)
    for start in range(0, len(line) - group + 1, group):
        assert np.isin(line[start : start + group], detection).sum() == 1
    assert len(detection) == len(line) // group


def test_every_place_in_a_group_is_left_out_equally_often() -> None:
    _, detection = grids.leave_one_out(np.arange(40000), 4, np.random.default_rng(0))
    # 10 000 draws of one place in four: standard deviation sqrt(10 000 3 / 16) = 43; four of them.
    assert np.abs(np.bincount(detection % 4) - 2500).max() < 4 * 43


def test_spacing_is_the_distance_to_the_farther_neighbour() -> None:
    assert grids.spacing_hz(np.array([5, 7, 13, 15]), 2.0).tolist() == [1.0, 3.0, 3.0, 1.0]
    assert grids.spacing_hz(np.array([5]), 2.0).tolist() == [np.inf]
