"""What the page says of a finding: its ties, and the experiment that separates them."""

from __future__ import annotations

from html import unescape

import numpy as np
import pytest

from robid_core import DiagnosedData, Diagnosis, Finding, Robot, SeparatingExperiment
from robid_core.testing import example_record
from robid_report.html import HtmlReport

NONE = np.empty(0)


@pytest.fixture
def robot() -> Robot:
    return Robot.load("one_axis")


@pytest.mark.parametrize("ratio", [3.7, 0.2])
def test_the_next_experiment_stands_below_the_ties(ratio: float) -> None:
    """Also where it separates nothing: the sentence is that of the verdict."""
    experiment = SeparatingExperiment(
        rivals=("friction.lugre at axis_1 (motor)",),
        amplitude=2.0,
        duration_s=12.0,
        n_period=2,
        n_settling=1,
        difference="opposite gravity torque at axis_1: -3 N m, recorded 1 to 2 N m",
        configuration=np.array([0.5]),
        reference=np.zeros((4, 1)),
        ratio=np.array([ratio]),
        repeat=np.array([0.1]),
    )
    finding = Finding(
        "cause", "friction.dahl", "axis_1", "motor", 50.0, 1e-9, 1.0, (), (), NONE, NONE, NONE, NONE, NONE, NONE,
        ties=experiment.rivals,
    )  # fmt: skip
    robot = Robot.load("one_axis")
    without, told = (
        unescape(HtmlReport().run(robot, diagnosis=Diagnosis("effects", "", findings=(one,))).html)
        for one in (finding, finding.replace(separation=experiment))
    )
    assert f"The next experiment: {experiment.sentence}." in told
    assert "cannot distinguish it from friction.lugre at axis_1 (motor)" in without
    assert "next experiment" not in without


def test_an_unknown_cause_has_no_empty_table(robot: Robot) -> None:
    finding = Finding(
        "unknown", "a function of motor speed", "axis_1", "", 50.0, 1e-9, np.nan, (), (),
        NONE, NONE, NONE, NONE, NONE, NONE,
    )  # fmt: skip
    page = HtmlReport().run(robot, diagnosis=Diagnosis("effects", "", findings=(finding,))).html
    assert "Unknown cause: a function of motor speed" in page
    assert '<table class="cause-numbers">' not in page


def test_the_time_is_that_of_all_recordings_of_a_diagnosis(robot: Robot) -> None:
    """Its page takes one of the records, for channels and poses."""
    data = DiagnosedData(
        4, 4, 0, 100.0, ("noise",), seconds=28.0, sources=("a.csv", "b.csv", "c.csv", "d.csv")
    )
    record = example_record(robot)
    page = unescape(
        HtmlReport().run(robot, record=record, diagnosis=Diagnosis("effects", "", data=data)).html
    )
    assert "<dt>recorded in 4 recordings</dt><dd>28.0 s</dd>" in page
    assert "<dt>Records</dt><dd>4 (a.csv to d.csv): 28.00 s of" in page
    older = HtmlReport().run(robot, record=record, diagnosis=Diagnosis("effects", "")).html
    assert "<dt>recorded</dt>" in older
