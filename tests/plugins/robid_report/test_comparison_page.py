"""Several fits on one page: intervals of the normal law, distances over joint errors, responses in shared poses."""

import base64
import gzip
import json
import re

import numpy as np
import pytest
from scipy.stats import norm

from robid_core import ConfigurationError, Fit, Frf, ParameterTable, Robot
from robid_core.testing import check_stage
from robid_report.comparison_figures import overlaid, shared_configurations
from robid_report.comparison_page import ComparisonPage
from robid_report.comparison_rows import cells_of, compared_rows


def fit(names: tuple[str, ...], estimate: list[float], error: list[float]) -> Fit:
    n = len(names)
    table = ParameterTable(
        names=names, units=("N m/rad",) * n, groups=("stiffness",) * n, start=np.ones(n), estimate=np.array(estimate),
        standard_error=np.array(error), reported=np.ones(n, dtype=bool), at_bound=np.zeros(n, dtype=bool),
    )  # fmt: skip
    return Fit(
        method="by hand", status="converged", converged=True, misfit=1.0, n_starts=1, n_agree=1, parameters=table,
        covariance=np.diag(np.square(error)), free_names=names,
    )  # fmt: skip


def frf(angles: list[float], frequency: np.ndarray) -> Frf:
    robot, angle = Robot.load("one_axis"), np.array(angles)[:, None]
    return Frf.from_arrays(
        robot.response(angle, frequency),
        frequency,
        angle=angle,
        sample_time_s=robot.sample_time_s,
        torque_hold="zero_order_hold",
        robot=robot,
    )


def test_intervals_hold_95_percent_and_distances_count_both_errors() -> None:
    first, second = cells_of([(100.0, 3.0), (110.0, 4.0)])
    reach = norm.ppf(0.975)
    assert first.interval == f"{100 - 3 * reach:.1f} to {100 + 3 * reach:.1f}"  # to the second digit of 3.0
    assert first.over_error == ""
    assert second.over_error == "+2.00"  # 10 over hypot(3, 4)
    low, high = 100 - 3 * reach, 110 + 4 * reach
    assert second.left == pytest.approx(100 * (110 - 4 * reach - low) / (high - low), abs=0.01)
    assert second.left is not None
    assert second.left + second.width == pytest.approx(100, abs=0.02)


def test_a_parameter_that_only_one_run_has_is_shown_beside_a_dash() -> None:
    rows = compared_rows({"a": fit(("k",), [1.0], [0.1]), "b": fit(("k", "load"), [1.0, 2.0], [0.1, np.nan])})
    assert [row.name for row in rows] == ["k", "load"]
    assert rows[1].cells[0].estimate == "–"
    assert rows[1].cells[1].interval == ""  # no standard error, no interval


def test_responses_are_overlaid_in_shared_configurations_each_at_its_own_lines() -> None:
    one, other = frf([0.3, 0.9], np.array([5.0, 10.0, 20.0])), frf([0.5, 0.9], np.array([4.0, 40.0]))
    assert shared_configurations([one, other]) == [(1, 1)]
    (figure,) = overlaid({"one": one, "other": other})
    magnitudes = {trace["name"]: trace for trace in figure["data"] if trace["yaxis"] == "y"}
    assert magnitudes["one"]["x"] == [5.0, 10.0, 20.0]
    assert magnitudes["other"]["x"] == [4.0, 40.0]
    expected = 20 * np.log10(np.abs(other.response[1, :, 0, 0]))
    np.testing.assert_allclose(magnitudes["other"]["y"], expected, atol=5.1e-5)


def test_the_page_holds_names_as_text_and_figures_as_data() -> None:
    evil = "<script>alert(1)</script>"
    fits = (fit((evil,), [1.0], [0.1]), fit((evil,), [1.1], [0.1]))
    response = frf([0.3], np.array([5.0, 10.0]))
    page = ComparisonPage(labels=("a", evil)).run(fits, (response, response)).html
    assert evil not in page
    assert "&lt;script&gt;alert(1)" in page
    found = re.search(r'id="page-data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data = json.loads(gzip.decompress(base64.b64decode(found[1])))
    entries = [entry for entry in data["pool"] if isinstance(entry, str)]
    assert evil in entries  # as a name of a trace
    assert page == ComparisonPage(labels=("a", evil)).run(fits, (response, response)).html


def test_without_a_shared_configuration_there_is_no_figure_and_no_script() -> None:
    fits = (fit(("k",), [1.0], [0.1]),) * 2
    responses = (frf([0.3], np.array([5.0])), frf([0.8], np.array([5.0])))
    page = ComparisonPage().run(fits, responses).html
    assert "share no configuration" in page
    assert "<script" not in page


def test_labels_are_one_for_each() -> None:
    with pytest.raises(ConfigurationError, match="labels: same, same are not a name of its own"):
        ComparisonPage(labels=("same", "same")).run((fit(("k",), [1.0], [0.1]),) * 2)


def test_the_stage_keeps_the_contract() -> None:
    check_stage(ComparisonPage, for_axes=(1, 2))
