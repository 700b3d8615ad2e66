"""The verdict as JSON: numbers that do not exist are null, intervals are two standard errors wide to either side."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from robid_core import (
    DiagnosedData,
    Diagnosis,
    Finding,
    MisfitTable,
    ParameterTable,
    ResidualCurve,
    ResponseCheck,
    SearchRecord,
    SeparatingExperiment,
    Timing,
    VisibleSize,
)
from robid_core.run.verdict_file import verdict_json

GAINS = np.array([40.0, 3.0, np.nan])


def finding(**changes: Any) -> Finding:
    fields = {
        "kind": "cause", "effect": "friction.stribeck", "on": "axis_2", "side": "motor", "gain": 43.0, "p_value": 1e-9,
        "share": float("nan"), "names": ("breakaway",), "units": ("N m",), "nominal": np.array([np.nan]),
        "value": np.array([0.3]), "standard_error": np.array([0.01]), "by_configuration": GAINS, "held_out": GAINS,
        "by_own_size": GAINS,
        "ties": ("friction.lugre at axis_2 (motor)",),
    }  # fmt: skip
    return Finding(**{**fields, **changes})


def test_what_is_told_stands_in_the_file() -> None:
    visible = (VisibleSize("friction.stribeck", "axis_2", "motor", "breakaway", "N m", 0.02),)
    search = SearchRecord(
        145, 61.0, ("friction.stribeck",), ("load.payload",), ("drive.saturation: no",), visible
    )
    data = DiagnosedData(4, 12, 2, 100.0, ("differences between periods",), ("loaded",), 1)
    diagnosis = Diagnosis("effects", "First line.\nSecond.", findings=(finding(),), search=search, data=data)
    told = json.loads(verdict_json(diagnosis, "arm.yaml", "abc"))
    assert told["robid_verdict"] == 2
    assert told["robot"] == {"name": "arm.yaml", "sha256": "abc"}
    assert told["verdict"] == ["First line.", "Second."]
    assert told["data"] == {
        "configurations": 4, "experiments": 12, "kept_apart": 2, "left_out": 1, "variants": ["loaded"],
        "highest_hz": 100.0, "noise": ["differences between periods"],
    }  # fmt: skip
    (found,) = told["findings"]
    assert found["by_configuration"] == [40.0, 3.0, None]
    assert found["share_of_ceiling"] is None
    (size,) = found["parameters"]
    assert size["nominal"] is None
    assert size["interval"] == pytest.approx([0.3 - 0.0196, 0.3 + 0.0196])
    assert told["searched"]["tried"] == 145
    assert told["searched"]["failed"] == ["drive.saturation: no"]
    (least,) = told["searched"]["visible"]
    assert (least["on"], least["parameter"], least["size"], least["unit"]) == (
        "axis_2",
        "breakaway",
        0.02,
        "N m",
    )
    assert (told["values"], told["errors"]) == ([], [])


def test_timing_tolerances_and_what_is_left_stand_in_the_file() -> None:
    table = ParameterTable(
        ("mass.link",), ("kg",), ("inertia",), np.array([2.0]), np.array([2.1]), np.array([0.01]), np.array([False]),
        np.array([False]), prior=np.array([0.02]),
    )  # fmt: skip
    diagnosis = Diagnosis(
        "effects",
        "",
        values=table,
        timing=Timing(("axis_1",), 0.001, np.array([1.03]), np.array([0.01])),
        left=MisfitTable(("axis_1",), np.array([0.0, 3.0, 9.0]), np.array([[1.0, 4.0]]), np.array([[np.nan, 2.0]])),
    )  # fmt: skip
    told = json.loads(verdict_json(diagnosis, "arm.yaml", "abc"))
    (mass,) = told["values"]
    assert (mass["nominal"], mass["estimate"], mass["tolerance"]) == (2.0, 2.1, 0.02)
    (lag,) = told["timing"]["lag"]
    assert (lag["name"], lag["unit"], lag["estimate"]) == ("axis_1", "sample", 1.03)
    assert told["left"]["axes"]["axis_1"] == {"lines": [1.0, 4.0], "other_bins": [None, 2.0]}


def test_of_what_the_residual_is_a_function_stands_in_the_file_where_that_has_a_meaning() -> None:
    none = np.zeros(2)
    curves = (
        ResidualCurve("axis_1", "motor speed, rad/s", "N m", none, none, none, None, 0.4, 0.3, 0.1),
        ResidualCurve("axis_1", "joint angle, rad", "N m", none, none, none, None, 0.2),
        ResidualCurve("axis_1", "frequency, Hz", "N m", none, none, none, none),
    )
    told = json.loads(verdict_json(Diagnosis("effects", "", residuals=curves), "arm", ""))
    speed, angle = told["residuals"]
    assert speed == {
        "axis": "axis_1",
        "variable": "motor speed, rad/s",
        "share": 0.4,
        "odd": 0.3,
        "even": 0.1,
    }
    assert (angle["share"], angle["odd"], angle["even"]) == (0.2, None, None)


def test_configurations_in_which_a_finding_is_seen_gain_three_standard_errors() -> None:
    assert finding().n_seen == 1
    assert finding().where == "axis_2 (motor)"
    assert finding(side="").where == "axis_2"


def experiment(ratio: list[float], repeat: float = 0.4, difference: str = "") -> SeparatingExperiment:
    return SeparatingExperiment(
        rivals=("friction.lugre at axis_2 (motor)", "friction.dahl at axis_2 (motor)")[: len(ratio)],
        amplitude=2.0,
        duration_s=90.0,
        n_period=2,
        n_settling=1,
        difference=difference,
        configuration=np.array([0.5, -1.25]),
        reference=np.zeros((4, 2)),
        ratio=np.array(ratio),
        repeat=np.full(len(ratio), repeat),
    )


def test_the_experiment_that_separates_ties_is_told() -> None:
    """Of several rivals the worst of those that it separates counts; the others are named."""
    best = experiment([3.7, 0.2], difference="opposite gravity torque at axis_2: -3 N m")
    told = json.loads(verdict_json(Diagnosis("effects", "", findings=(finding(separation=best),)), "arm", ""))
    found = told["findings"][0]["separation"]
    assert found["configuration"] == [0.5, -1.25]
    assert [row["separated"] for row in found["rivals"]] == [True, False]
    assert [row["expected"] for row in found["rivals"]] == [3.7, 0.2]
    assert best.sentence == (
        "separate it from friction.lugre at axis_2 (motor) with: configuration [0.5, -1.25] (opposite gravity torque "
        "at axis_2: -3 N m), recorded speeds times 2; expected log-likelihood ratio 3.7 an experiment (1.5 min), 0.4 "
        "where a recorded one is repeated; none of this kind separates it from friction.dahl at axis_2 (motor)"
    )
    assert "repeated" not in experiment([3.7], repeat=np.nan).sentence
    none = json.loads(verdict_json(Diagnosis("effects", "", findings=(finding(),)), "arm", ""))
    assert none["findings"][0]["separation"] is None


def test_where_no_experiment_separates_ties_it_is_said() -> None:
    text = experiment([0.3, 0.7]).sentence
    assert text.startswith("no experiment of this kind")
    assert text.endswith("expected log-likelihood ratio 0.7 an experiment at most")


def test_what_responses_say_of_stiffnesses_stands_in_the_file() -> None:
    response_check = ResponseCheck(
        "frf.lrm, fit.log_response", "", 1.1, 3.5, ("gear_stiffness.axis_1", "gear_stiffness.axis_2"),
        ("N m/rad", "N m/rad"), np.array([101.0, 90.0]), np.array([0.8, 0.8]), np.array([100.0, 100.0]),
        np.array([0.6, 0.6]), np.array([1.0, -10.0]),
    )  # fmt: skip
    told = json.loads(
        verdict_json(Diagnosis("effects", "", response_check=response_check), "arm.yaml", "abc")
    )["response_check"]
    first, second = told["stiffnesses"]
    assert (told["method"], told["reason"], told["limit"]) == ("frf.lrm, fit.log_response", None, 3.5)
    assert (first["agree"], second["agree"], second["z"]) == (True, False, -10.0)
    assert first["by_responses"] == {"estimate": 101.0, "standard_error": 0.8}
    assert first["by_torques"] == {"estimate": 100.0, "standard_error": 0.6}


def test_without_a_check_the_file_says_why() -> None:
    none, number = np.empty(0), float("nan")
    response_check = ResponseCheck(
        "", "the record does not repeat", number, number, (), (), none, none, none, none, none
    )
    told = json.loads(
        verdict_json(Diagnosis("effects", "", response_check=response_check), "arm.yaml", "abc")
    )["response_check"]
    assert (told["reason"], told["limit"], told["stiffnesses"]) == ("the record does not repeat", None, [])
    assert json.loads(verdict_json(Diagnosis("effects", ""), "arm.yaml", "abc"))["response_check"] is None
