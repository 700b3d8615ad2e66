"""Numbers on the page: significant digits, percent, and samples that keep the extremes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robid_report.numbers import compact, percent, rounded_to, significant
from robid_report.traces import kept_samples


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (412345.0, 4, "412\u202f300"),
        (0.00421, 3, "0.00421"),
        (-3.1648, 4, "−3.165"),
        (95.10893, 4, "95.11"),
        (9.9996, 4, "10.00"),
        (0.0, 4, "0.000"),
        (1.234e-7, 3, "1.23×10⁻⁷"),
        (-2.5e12, 2, "−2.5×10¹²"),
        (math.nan, 4, "–"),
        (math.inf, 4, "∞"),
        (-math.inf, 4, "−∞"),
    ],
)
def test_significant_digits(value: float, digits: int, text: str) -> None:
    assert significant(value, digits) == text


@pytest.mark.parametrize(
    ("share", "signed", "text"),
    [
        (0.0408336, False, "4.08\u202f%"),
        (0.0000148, False, "0.0015\u202f%"),
        (-0.0629, True, "−6.29\u202f%"),
        (0.359, True, "+35.9\u202f%"),
        (1.0365, True, "+104\u202f%"),
        (0.0, True, "+0.00\u202f%"),
        (math.nan, False, "–"),
    ],
)
def test_percent(share: float, signed: bool, text: str) -> None:
    assert percent(share, signed) == text


def test_holes_become_null_and_whole_numbers_lose_their_point() -> None:
    assert compact(np.array([[1.0, np.nan], [-0.001, 2.347]]), 2) == [[1, None], [0, 2.35]]
    assert rounded_to(np.array([123456.0, 0.123]), 3) == [123000, 0]
    assert rounded_to(np.array([0.000123456]), 3) == [0.000123]


def test_a_single_spike_of_the_residual_is_always_drawn() -> None:
    draw = np.random.default_rng(0)
    for spike in (0, 1, 77_777, 99_998, 99_999):
        residual = draw.normal(size=100_000)
        residual[spike] = -40.0
        kept = kept_samples(residual)
        assert spike in kept
        assert {0, 99_999} <= set(kept.tolist())
        assert (np.diff(kept) > 0).all()
        assert len(kept) <= 1802


def test_short_recordings_are_drawn_whole() -> None:
    np.testing.assert_array_equal(kept_samples(np.zeros(1800)), np.arange(1800))
