"""Pictures of what is left: told largest first, drawn where the numbers are, scales as they say."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robid_core import Diagnosis, FloatArray, ResidualCurve, Robot
from robid_report.chart import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, chart
from robid_report.html import HtmlReport
from robid_report.residuals import residual_sections


def curve(variable: str, share: float, odd: float = np.nan, even: float = np.nan) -> ResidualCurve:
    x = np.linspace(-1.0, 1.0, 5)
    return ResidualCurve("axis_1", variable, "N m", x, x, 0 * x, None, share, odd, even)


def circles(svg: str) -> FloatArray:
    return np.array([[float(n) for n in pair] for pair in re.findall(r'cx="([\d.]+)" cy="([\d.]+)"', svg)])


def test_the_sentence_tells_the_largest_shares_first_with_their_symmetry() -> None:
    curves = (
        curve("motor speed, rad/s", 0.3, 0.25, 0.05),
        curve("joint angle, rad", 0.002),
        curve("friction over size of the load, N m at the motor", 0.62),
    )
    (section,) = residual_sections(Diagnosis("effects", "", residuals=curves))
    assert section["open"]
    assert section["told"].endswith(
        ": friction over size of the load 62.0\u202f%; motor speed 30.0\u202f% (odd 25.0\u202f%, even 5.00\u202f%)."
    )
    (nothing,) = residual_sections(Diagnosis("effects", "", residuals=(curve("joint angle, rad", 0.0),)))
    assert "No single variable explains" in nothing["told"]


def test_dots_stand_where_their_numbers_are_on_straight_and_on_logarithmic_scales() -> None:
    x, y = np.array([1.0, 10.0, 100.0]), np.array([2.0, 20.0, 200.0])
    straight = circles(chart("speed", "N m", x, y, {"law": y}, spoken=""))
    across = LEFT + (WIDTH - LEFT - RIGHT) * (x - 1) / 99
    up = HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * (y - 2) / 198
    np.testing.assert_allclose(straight, np.stack([across, up], axis=1), atol=0.06)  # tenths are written
    by_decade = circles(chart("f", "N m", x, y, {"law": y}, spoken="", logarithmic=(True, True)))
    assert np.diff(by_decade, axis=0)[0] == pytest.approx(np.diff(by_decade, axis=0)[1], abs=0.11)


def test_sizes_of_nothing_are_drawn_at_the_edge_of_a_logarithmic_scale() -> None:
    """A perfect model leaves zero, whose logarithm nobody can draw."""
    x = np.array([1.0, 2.0])
    svg = chart("f", "N", x, np.zeros(2), {"law": np.ones(2)}, spoken="", logarithmic=(True, True))
    assert np.isfinite(circles(svg)).all()
    assert "force, N" in svg
    assert "nan" not in svg


def test_the_page_has_the_pictures_and_says_what_they_are() -> None:
    page = (
        HtmlReport()
        .run(
            Robot.load("one_axis"), diagnosis=Diagnosis("effects", "", residuals=(curve("a < b, rad", 0.5),))
        )
        .html
    )
    assert "Residual torque over each variable" in page
    assert "a &lt; b, rad" in page
    assert "a < b, rad" not in page
