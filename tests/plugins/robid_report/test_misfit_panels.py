"""Fits of torques draw their residual in standard errors over frequency, from the misfit of axes and bands."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.stats import chi2

from robid_core import MisfitTable, Robot
from robid_core.testing import example_fit
from robid_report.html import HtmlReport
from robid_report.misfits import misfit_sections

EDGES = np.array([0.0, 3.0, 10.0, 30.0])


def table(
    lines: list[list[float]], other: list[list[float]], names: tuple[str, ...] = ("axis_1",)
) -> MisfitTable:
    return MisfitTable(names, EDGES, np.array(lines), np.array(other))


def picture(lines: list[float], other: list[float]) -> str:
    fit = example_fit(Robot.load("one_axis")).replace(misfit_table=table([lines], [other]))
    ((_, found),) = misfit_sections(fit, None)[0]["pictures"]
    return str(found)


def heights(drawn: str, name: str) -> list[float]:
    path = re.search(rf'<path class="{name}" d="([^"]*)"', drawn)
    assert path is not None
    return [float(point.split()[1]) for point in re.findall(r"[ML]([\d. ]+)", path[1])]


def test_the_root_of_the_misfit_is_drawn_as_steps_over_the_bands() -> None:
    """A misfit of 100 in one band stands two decades of power, one of standard errors, above that of 1."""
    drawn = picture([1.0, 100.0, 1.0], [np.nan, 1.0, 1.0])
    lines, level = heights(drawn, "law"), heights(drawn, "torque")
    assert len(lines) == len(level) == 6
    assert lines[0] == lines[1] == level[0]
    assert lines[2] == lines[3] < level[0]  # higher on the page
    assert "residual (rms), std. errors" in drawn


def test_a_band_without_bins_is_a_gap() -> None:
    drawn = picture([1.0, np.nan, 4.0], [np.nan] * 3)
    path = re.search(r'<path class="law" d="([^"]*)"', drawn)
    assert path is not None
    assert path[1].count("M") == 2
    assert "nan" not in drawn
    assert 'class="even"' not in drawn


def test_an_axis_without_any_bin_has_no_picture() -> None:
    fit = example_fit(Robot.load("one_axis")).replace(misfit_table=table([[np.nan] * 3], [[np.nan] * 3]))
    assert misfit_sections(fit, None)[0]["pictures"] == [("axis_1", None)]


@pytest.mark.parametrize("n_axis", [1, 2])
def test_the_page_of_a_torque_fit_shows_them(n_axis: int) -> None:
    names = tuple(f"axis_{a + 1}" for a in range(n_axis))
    whole = table([[1.0, 2.0, 3.0]] * n_axis, [[1.0, 1.0, 1.0]] * n_axis, names)
    robot = Robot.load("one_axis")
    page = HtmlReport().run(robot, fit=example_fit(robot).replace(misfit_table=whole)).html
    assert "Residuals in standard errors" in page
    assert page.count("in standard errors over frequency") == n_axis


def ordinates(drawn: str) -> list[float]:
    """The numbers beside the ordinate."""
    return [float(text) for text in re.findall(r'text-anchor="end">([\d.]+)<', drawn)]


def with_freedom(lines: list[list[float]], freedom: float) -> list[str]:
    names = tuple(f"axis_{a + 1}" for a in range(len(lines)))
    n = np.full((len(lines), 3), freedom)
    whole = table(lines, [[1.0] * 3] * len(lines), names).replace(line_freedom=n, other_freedom=n)
    fit = example_fit(Robot.load("one_axis")).replace(misfit_table=whole)
    return [str(drawn) for _, drawn in misfit_sections(fit, None)[0]["pictures"]]


@pytest.mark.parametrize("worst", [1.05, 4.0, 100.0, 3e4])
def test_all_axes_have_one_range_with_three_ticks_and_one_in_it(worst: float) -> None:
    calm, wild = with_freedom([[0.97, 1.02, 1.05], [1.0, worst, 1.0]], 200.0)
    assert ordinates(calm) == ordinates(wild)
    assert len(ordinates(calm)) >= 3
    assert min(ordinates(calm)) <= 1.0 < max(ordinates(calm))
    # What is within 3 % of one stands within a tenth of the panel of it.
    level = heights(calm, "torque")[0]
    assert all(abs(one - level) < 20 for one in heights(calm, "law"))


@pytest.mark.parametrize("freedom", [3.0, 10.0, 1000.0])
def test_the_band_is_that_of_chi_square(freedom: float) -> None:
    """Heights of the area's edges against the exact quantiles, by the height of 1 and of a residual of 2."""
    (drawn,) = with_freedom([[1.0, 4.0, 1.0]], freedom)
    area = re.search(r'<path class="scatter" d="M([^"]*)Z"', drawn)
    assert area is not None
    edge = [float(point.split()[1]) for point in area[1].split("L")]
    one, two = heights(drawn, "law")[0], heights(drawn, "law")[2]
    low, high = (2 ** ((height - one) / (two - one)) for height in (max(edge), min(edge)))
    exact = np.sqrt(chi2.ppf([0.025, 0.975], freedom) / freedom)
    np.testing.assert_allclose([low, high], exact, rtol=0.02)


def test_no_label_is_cut_at_the_right_edge() -> None:
    drawn = picture([1.0, 2.0, 3.0], [1.0, 1.0, 1.0])
    places = re.findall(r'<text x="([\d.]+)" y="[\d.]+" text-anchor="middle">([\d.]+)<', drawn)
    assert places
    assert all(float(x) + 4.5 * len(text) <= 560 for x, text in places)
