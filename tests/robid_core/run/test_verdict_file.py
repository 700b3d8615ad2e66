"""The verdict as JSON: numbers that do not exist are null, intervals are two standard errors wide to either side."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from robid_core import Diagnosis, Finding, SearchRecord, VisibleSize
from robid_core.run.verdict_file import verdict_json

GAINS = np.array([40.0, 3.0, np.nan])


def finding(**changes: Any) -> Finding:
    fields = {
        "kind": "cause", "effect": "friction.stribeck", "on": "axis_2", "side": "motor", "gain": 43.0, "p_value": 1e-9,
        "share": float("nan"), "names": ("breakaway",), "units": ("N m",), "told": np.array([np.nan]),
        "value": np.array([0.3]), "standard_error": np.array([0.01]), "by_configuration": GAINS, "held_out": GAINS,
        "ties": ("friction.lugre at axis_2 (motor)",),
    }  # fmt: skip
    return Finding(**{**fields, **changes})


def test_what_is_told_stands_in_the_file() -> None:
    visible = (VisibleSize("friction.stribeck", "axis_2", "motor", "breakaway", "N m", 0.02),)
    search = SearchRecord(
        145, 61.0, ("friction.stribeck",), ("load.payload",), ("drive.saturation: no",), visible
    )
    diagnosis = Diagnosis("effects", "First line.\nSecond.", findings=(finding(),), search=search)
    told = json.loads(verdict_json(diagnosis, "arm.yaml", "abc"))
    assert told["robid_verdict"] == 1
    assert told["robot"] == {"name": "arm.yaml", "sha256": "abc"}
    assert told["verdict"] == ["First line.", "Second."]
    (found,) = told["findings"]
    assert found["by_configuration"] == [40.0, 3.0, None]
    assert found["share_of_ceiling"] is None
    (size,) = found["parameters"]
    assert size["told"] is None
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


def test_configurations_in_which_a_finding_is_seen_gain_three_standard_errors() -> None:
    assert finding().n_seen == 1
    assert finding().where == "axis_2 (motor)"
    assert finding(side="").where == "axis_2"
