"""Numbers on the page: significant digits, percent, and samples that keep the extremes."""

from __future__ import annotations

import math

import pytest

from robid_core.commands.fit_screen import number_text
from robid_report.numbers import percent, significant, to_error, with_code, with_error


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
    ("value", "error", "text"),
    [
        (204_986.2, 10.3, "204\u202f986"),
        (304_182.0, 890.0, "304\u202f180"),
        (23_999.762, 0.886, "23\u202f999.76"),
        (0.30416, 0.0089, "0.3042"),
        (-99.96, 0.0996, "−99.96"),  # the error rounds to 0.10
        (4.213, 5.1, "4.2"),
        (0.4213, 51.0, "0.42"),  # two digits, however large the error
        (1234.5678, math.nan, "1235"),
        (1234.5678, math.inf, "1235"),
    ],
)
def test_a_value_is_written_to_the_second_digit_of_its_error_on_page_and_terminal(
    value: float, error: float, text: str
) -> None:
    written = to_error(value, error).replace("1\u202f235", "1235")
    assert written == text
    assert float(number_text(value, error)) == float(text.replace("\u202f", "").replace("−", "-"))


def test_value_and_error_end_at_the_same_digit() -> None:
    assert with_error(204_986.2, 10.3) == "204\u202f986 ± 10"
    assert with_error(0.304163, 0.00894) == "0.3042 ± 0.0089"


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


def test_code_in_a_sentence_is_marked_up_and_nothing_else_is() -> None:
    text = "allow `passes` & <more> of /home/anna/lab/a.csv; one ` alone"
    assert with_code(text) == "allow <code>passes</code> &amp; &lt;more&gt; of a.csv; one ` alone"
