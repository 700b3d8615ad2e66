"""What a notebook shows of artifacts: one line as text; a sentence, doubts, verdict and a table as HTML."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from robid_core import (
    Artifact,
    DenseRun,
    Diagnosis,
    Doubt,
    Excitation,
    Finding,
    FrictionCurve,
    MisfitTable,
    PredictionErrors,
    Record,
    ResponseCheck,
    Robot,
    SeparatingExperiment,
    Table,
    TimeComparison,
    array,
)
from robid_core.arrays import FloatArray
from robid_core.testing import (
    example_artifacts,
    example_configurations,
    example_diagnosis,
    example_excitation,
    example_fit,
    example_frf,
    example_record,
    example_robot,
)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return example_robot(2)


@pytest.fixture
def finding() -> Finding:
    unknown = np.full(2, np.nan)
    return Finding(
        "cause", "friction.dahl", "axis_1", "motor", 40.0, 1e-4, 0.9, ("stiffness", "level"), ("N m/rad", "N m"),
        np.zeros(2), np.array([2.0, 0.5]), np.array([0.1, 0.02]), unknown, unknown, unknown, ties=("friction.lugre",),
    )  # fmt: skip


def cells(html: str) -> list[list[str]]:
    """Return the text of each row of the first table."""
    body = html[html.index("<tbody>") : html.index("</tbody>")]
    return [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in body.split("<tr>")[1:]]


def test_every_artifact_is_one_short_line_as_text(robot: Robot) -> None:
    fit = example_fit(robot)
    nested = [
        fit.parameters,
        fit.model,
        fit.response,
        example_record(robot).run,
        example_diagnosis(robot).time[0],
    ]
    for artifact in (*example_artifacts(robot).values(), *nested):
        text = repr(artifact)
        assert text.startswith(f"<{type(artifact).__name__}")
        assert "\n" not in text
        assert len(text) < 200
    assert repr(fit) == (
        "<Fit by example: converged, misfit 1 against the stated uncertainty; 3 of 3 starts agree>"
    )
    assert repr(example_frf(robot)).startswith(
        "<Frf by example: 2 configurations, 19 lines from 10 to 82 Hz of axis"
    )


def test_a_strangers_artifact_is_told_by_the_lengths_of_its_axes_or_by_its_own_words() -> None:
    @dataclass(frozen=True, eq=False)
    class Wear(Artifact):
        depth: FloatArray = array("n_axis n_year", "m")

        def table(self) -> Table:
            return Table(depth=self.depth[:, 0].tolist())

    @dataclass(frozen=True, eq=False)
    class Own(Artifact):
        name: str

        def __repr__(self) -> str:
            return f"own {self.name}"

    wear = Wear(np.array([[0.5, 1.0], [2.0, 3.0]]))
    assert repr(wear) == "<Wear n_axis 2, n_year 2>"
    assert cells(wear._repr_html_()) == [["0.5"], ["2"]]
    assert repr(Own("words")) == "own words"


def test_what_has_a_table_shows_it(robot: Robot) -> None:
    frf, record, fit = example_frf(robot), example_record(robot), example_fit(robot)
    first = cells(frf._repr_html_())[0]
    assert first[:4] == ["0", "10", "axis_1", "axis_1"]
    assert first[6] == f"{abs(frf.response[0, 0, 0, 0]):.5g}"
    shown = cells(record._repr_html_())
    position = record.run.values("motor_position")[0, 0, 0, 0]
    assert shown[7][:3] == ["0.007", f"{position[7, 0]:.5g}", f"{position[7, 1]:.5g}"]
    assert cells(fit.parameters._repr_html_()) == cells(fit._repr_html_())
    comparison: TimeComparison = example_diagnosis(robot).time[0]
    assert cells(comparison._repr_html_())[3][1] == f"{comparison.measured[3, 0]:.5g}"


def test_a_record_of_several_runs_shows_no_samples_but_its_sentence(robot: Robot) -> None:
    record: Record = example_record(robot)
    html = record.replace(runs=(record.run, record.run))._repr_html_()
    assert "<table" not in html
    assert "24 s of axis_1, axis_2" in html


def test_a_verdict_keeps_its_lines_and_doubts_stand_before_it(finding: Finding) -> None:
    diagnosis = Diagnosis(
        "search",
        "axis_1: <one>.\naxis_2: two.",
        findings=(finding,),
        doubts=(Doubt("noise", "no noise", "measure it"),),
    )
    html = diagnosis._repr_html_()
    assert "<p>axis_1: &lt;one&gt;.<br>axis_2: two.</p>" in html
    assert html.index("no noise; measure it") < html.index("axis_2: two.")
    assert [row[3] for row in cells(html)] == ["stiffness", "level"]
    assert repr(diagnosis) == "<Diagnosis by search: found friction.dahl at axis_1 (motor)>"
    assert "<table" not in Diagnosis("search", "Nothing.")._repr_html_()


def test_a_finding_is_a_sentence_and_its_numbers(finding: Finding) -> None:
    assert repr(finding) == (
        "<Finding (cause): friction.dahl at axis_1 (motor), gain 40 of twice the log-likelihood, p = 0.0001 after the "
        "search; these data cannot distinguish it from friction.lugre>"
    )
    assert finding.table()["value"] == [2.0, 0.5]
    assert finding.table() == Diagnosis("search", "one", findings=(finding,)).table()


def test_an_excitation_tells_what_it_asks_and_what_was_predicted(robot: Robot) -> None:
    excitation: Excitation = example_excitation(robot, example_configurations(robot))
    table = excitation.table()
    assert list(table) == ["configuration", "axis", "reference_rad_s"]
    assert table["configuration"] == [0, 0, 1, 1]
    assert table["axis"] == ["axis_1", "axis_2"] * 2
    largest = np.abs(excitation.reference).max(axis=(1, 2, 3))
    np.testing.assert_array_equal(table["reference_rad_s"], largest.ravel())
    torque = np.array([[1.0, 2.0], [3.0, 4.0]])
    cleared = excitation.replace(predicted_torque=torque, torque_limit=np.array([2.0, 8.0])).table()
    assert cleared["torque_nm"] == [1.0, 2.0, 3.0, 4.0]
    assert cleared["of_torque_limit"] == [0.5, 0.25, 1.5, 0.5]


def test_the_small_artifacts_are_rows_of_their_numbers() -> None:
    two, names = np.array([1.0, 2.0]), ("axis_1", "axis_2")
    errors = PredictionErrors(
        "fit", "torque in open loop", "N m", names, two, two / 100, two / 200, two / 50, np.array([False, True]),
        noise=two / 400,
    )  # fmt: skip
    assert list(errors.table().rows())[1] == {
        "axis": "axis_2", "unit": "N m", "rms": 2.0, "relative": 0.02, "low": 0.01, "high": 0.04, "still": True,
        "noise": 0.005,
    }  # fmt: skip
    assert (
        repr(errors) == "<PredictionErrors of the torque in open loop by fit: 1 to 2 % of what was measured>"
    )
    misfit = MisfitTable(names, np.array([0.0, 3.0, 10.0]), np.array([[1, 2], [3, np.nan]]), np.ones((2, 2)))
    assert list(misfit.table().rows())[2] == {
        "axis": "axis_2",
        "band": "below 3 Hz",
        "lines": 3.0,
        "other": 1.0,
    }
    assert "lines 1 to 3, other bins 1 to 1" in repr(misfit)
    check = ResponseCheck(
        "frf.log", "", 1.0, 3.0, ("a", "b"), ("N m/rad",) * 2, two, two, two, two, np.array([1.0, 4.0])
    )
    assert check.table()["agree"] == [True, False]
    assert "1 of 2 stiffnesses agree" in repr(check)
    assert "not made: no lines" in repr(check.replace(reason="no lines"))
    curve = FrictionCurve("axis_1", "coulomb", "rad/s", "N m", two, two / 2, two / 3)
    assert curve.table() == {"speed": [1.0, 2.0], "measured": [0.5, 1.0], "fitted": [1 / 3, 2 / 3]}
    assert "2 points from 1 to 2 rad/s, friction in N m" in repr(curve)
    next_one = SeparatingExperiment(
        ("friction.lugre", "friction.dahl"),
        0.5,
        90.0,
        3,
        1,
        "",
        two,
        np.zeros((5, 2)),
        np.array([4.0, 0.2]),
        two,
    )
    assert next_one.table()["separated"] == [True, False]
    assert next_one.sentence in repr(next_one)


def test_a_run_is_told_by_its_channels(robot: Robot) -> None:
    run: DenseRun = example_record(robot).run
    rows: list[dict[str, Any]] = list(run.table().rows())
    assert [(row["channel"], row["side"], row["unit"]) for row in rows] == [
        ("motor_position", "motor", "rad"), ("motor_torque", "motor", "N m"), ("speed_reference", "motor", "rad/s"),
    ]  # fmt: skip
    assert rows[1]["largest"] == run.values("motor_torque").max()
    assert repr(run) == "<DenseRun of 8 experiments, 3 periods of 500 samples each (0.5 s)>"
    channel = run.channels["motor_torque"]
    lost = run.replace(
        channels={"motor_torque": channel.replace(values=np.full(channel.values.shape, np.nan))}
    )
    assert np.isnan(lost.table()["smallest"]).all()
