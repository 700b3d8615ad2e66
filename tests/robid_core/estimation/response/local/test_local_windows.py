"""Windows of local methods: sizes, offsets, and what is said where there are too few lines."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from robid_core import ConfigurationError, DataRejected
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.window import choose_windows, windows_of_lines, windows_of_width


def test_unknowns_are_those_of_the_thesis() -> None:
    # (3.19): (R + 1) n_u; (3.28): R more; (3.31): R n_y more, 42 for the twelve signals of the joint approach.
    assert LocalModel("miso", 2, 0).unknowns(6, 6) == 18
    assert LocalModel("miso").unknowns(6, 6) == 20
    assert LocalModel("mimo").unknowns(6, 6) == 30
    assert LocalModel("mimo").unknowns(6, 12) == 42
    # One polynomial for all six outputs: six outputs share two unknowns.
    assert LocalModel("scalar").unknowns(6, 6) == pytest.approx(18 + 2 / 6)


def test_one_experiment_of_six_axes_needs_thirty_lines_and_six_need_five() -> None:
    mimo = LocalModel("mimo")
    assert mimo.smallest_window(6, 6, 1) == 30
    assert mimo.smallest_window(6, 6, 1, freedom=6) == 36  # a covariance of six outputs that is not singular
    assert mimo.smallest_window(6, 6, 6) == 5
    # More experiments than inputs bring noise only: without it a line gives six equations, however many there are.
    assert mimo.smallest_window(6, 6, 24) == 5
    assert mimo.smallest_window(6, 12, 1) == 42


@given(
    st.integers(2, 60),
    st.integers(1, 60),
    st.integers(0, 2**32 - 1),
)
def test_windows_keep_their_size_and_hold_their_line(n_freq: int, size: int, seed: int) -> None:
    frequency = np.cumsum(np.random.default_rng(seed).uniform(0.1, 3.0, n_freq))
    size = min(size, n_freq)
    windows = windows_of_lines(frequency, size)
    assert (windows.size == size).all()
    assert (windows.first >= 0).all()
    assert (windows.last < n_freq).all()
    assert (windows.first <= np.arange(n_freq)).all()
    assert (windows.last >= np.arange(n_freq)).all()
    offset = windows.offset()
    # True frequencies: the half width times the offset gives them back, and the farthest line is at one.
    index, _ = windows.lines()
    assert windows.half_width_hz[:, None] * offset + frequency[:, None] == pytest.approx(frequency[index])
    if size > 1:
        assert np.abs(offset).max(axis=1) == pytest.approx(1.0)
    assert (offset[np.arange(n_freq), np.arange(n_freq) - windows.first] == 0).all()


def test_windows_in_hertz_hold_the_lines_of_a_band_and_lean_inward() -> None:
    frequency = np.array([1.0, 2.0, 4.0, 5.0, 6.0, 10.0])
    windows = windows_of_width(frequency, 4.0)
    held = [frequency[a : b + 1].tolist() for a, b in zip(windows.first, windows.last, strict=True)]
    assert held == [[1, 2, 4, 5], [1, 2, 4, 5], [2, 4, 5, 6], [4, 5, 6], [4, 5, 6], [6, 10]]
    index, counts = windows.lines()
    assert counts.sum(axis=1).tolist() == [4, 4, 4, 3, 3, 2]
    assert index.max() == 5


def test_too_few_lines_name_the_unknowns_and_what_would_do() -> None:
    frequency, mimo = np.geomspace(4, 80, 120), LocalModel("mimo")
    with pytest.raises(
        ConfigurationError,
        match=r"has 20 lines, and 30 unknowns per output need 30 with 1 experiment .* measure 2",
    ):
        choose_windows(frequency, mimo, 6, 6, 1, window_lines=20)
    with pytest.raises(ConfigurationError, match=r"around \d+\.\d+ Hz has 1 lines"):
        choose_windows(frequency, mimo, 6, 6, 6, window_hz=0.3)
    with pytest.raises(
        DataRejected, match=r"need a window of 30 lines with 1 experiment of 6 inputs, .* has 20; measure 2"
    ):
        choose_windows(frequency[:20], mimo, 6, 6, 1)
    with pytest.raises(
        DataRejected, match=r"30 unknowns per output and 3 per experiment need a window of 33 lines"
    ):
        choose_windows(frequency[:32], LocalModel("mimo", transient_order=2), 6, 6, 1)
    with pytest.raises(ConfigurationError, match="both given"):
        choose_windows(frequency, mimo, 6, 6, 6, window_lines=20, window_hz=3.0)


def test_the_default_window_leaves_four_degrees_of_freedom_per_output() -> None:
    frequency, mimo = np.geomspace(4, 80, 120), LocalModel("mimo")
    for n_exp in (1, 2, 3, 6, 24):
        size = int(choose_windows(frequency, mimo, 6, 6, n_exp).size[0])
        assert size % 2 == 1
        assert mimo.freedom(size, 6, 6, n_exp) >= 24
        assert size * min(n_exp, 6) >= 30 + 6
        assert mimo.freedom(size - 2, 6, 6, n_exp) < 24 or (size - 2) * min(n_exp, 6) < 36
    # Where the band is shorter, all of it.
    assert choose_windows(frequency[:40], mimo, 6, 6, 1).size.tolist() == [40] * 40
