"""`robid show` of a diagnosis or a check: the tables of its page, the whole verdict, and no names of classes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robid_core import (
    ConfigurationError,
    Diagnosis,
    MisfitTable,
    PredictionErrors,
    Robot,
    RunErrors,
    is_determined,
)
from robid_core.commands import show
from robid_core.commands.fit_screen import fit_table
from robid_core.commands.show import artifact_lines
from robid_core.testing import example_diagnosis, example_fit

ROBOT = Robot.load("one_axis")
LONG = "elbow: no effect of the catalogue explains the residual; a function of motor speed would, and much more of it"
AXES = ("axis_1", "axis_2")


def check() -> Diagnosis:
    """Two models, two axes, two runs, one of them predicted."""
    two, still = np.array([0.13, 0.43]), np.array([False, True])
    errors = tuple(
        PredictionErrors(model, "torque", "N m", AXES, two * k, two * k / 10, two / 20, two * np.nan, still)
        for model, k in (("fit", 1.0), ("robot file", 2.0))
    )
    runs = RunErrors(
        "fit", "torque", "N m", AXES, ("a.csv", "b.csv"), np.array([False, True]), np.outer([1, 2], two),
        np.outer([0.1, 0.2], two),
    )  # fmt: skip
    left = MisfitTable(AXES, np.array([0.0, 3.0]), np.array([[1.0], [9.0]]), np.ones((2, 1)))
    return example_diagnosis(ROBOT).replace(verdict=LONG, errors=errors, runs=(runs,), left=left)


def test_a_check_is_shown_by_axis_and_run_with_its_whole_verdict() -> None:
    text = "\n".join(artifact_lines(check()))
    for wanted in (
        LONG,
        "0.13 N m",
        "0.26 N m",
        "1.3 %",
        "axis_2 (hardly moved)",
        "a.csv  of the fit",
        "9 | 1",
    ):
        assert wanted in text
    (predicted,) = [line for line in text.splitlines() if line.startswith("  b.csv")]
    assert predicted.split()[1:] == ["predicted", "0.26", "N", "m", "2.6", "%", "0.86", "N", "m", "8.6", "%"]
    for internal in ("TimeComparison", "n_axis", "RunErrors", "still", "absent"):
        assert internal not in text


def test_what_the_data_do_not_determine_is_said_as_on_the_page() -> None:
    fit = example_fit(ROBOT)
    table = fit.parameters
    far = fit.replace(
        parameters=table.replace(estimate=np.array([80000.0, 3.2e-8]), standard_error=np.array([2e3, 1.1]))
    )
    rows = {line.split()[0]: line for line in fit_table(far, {}, everything=True)[1:]}
    assert rows["gear_stiffness.axis_1"].endswith("2e+03")
    assert rows["gear_damping.axis_1"].endswith("1.1, not determined")
    assert is_determined(2e3, 80000.0)
    assert not is_determined(1.1, 3.2e-8)


@pytest.mark.parametrize("words", [("runs/nope",), ("nope", "fit")])
def test_a_run_that_is_not_there_is_called_a_run(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("cell", "lab"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "manifest.json").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match=r"nope: no such run; there are: runs/cell, runs/lab"):
        show.command(Path(words[0]), *words[1:])
