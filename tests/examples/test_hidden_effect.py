"""The example: an effect that only the plant has is found, and the extended robot predicts other poses."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from robid_core import Record, Robot, simulate_record
from robid_core.artifacts import Diagnosis
from robid_core.pipeline import Pipeline
from robid_core.run import run_pipeline

EXAMPLE = Path(__file__).parents[2] / "examples" / "hidden_effect"
HIDDEN = 0.05


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run's folder."""
    project = tmp_path_factory.mktemp("hidden_effect")
    for name in ("pipeline.yaml", "plant.yaml"):
        shutil.copy(EXAMPLE / name, project / name)
    result = run_pipeline(Pipeline.load(project / "pipeline.yaml"))
    assert result.exit_code == 0
    return project / "runs" / "hidden_effect"


def test_the_verdict_names_the_effect_with_its_size(folder: Path) -> None:
    """Nothing else is found; the interval of the size, widened to four standard errors, holds the truth."""
    told = json.loads((folder / "verdict.explain.json").read_text(encoding="utf-8"))
    (finding,) = told["findings"]
    assert (finding["kind"], finding["effect"], finding["on"]) == (
        "cause",
        "friction.load_dependent",
        "axis_1",
    )
    (size,) = finding["parameters"]
    assert size["name"] == "load_coulomb"
    assert size["nominal"] is None
    assert abs(size["estimate"] - HIDDEN) < 4 * size["standard_error"]
    assert told["searched"]["failed"] == []


def test_responses_agree_about_the_spring(folder: Path) -> None:
    """Both ways hold the plant's own spring, the responses to half a percent."""
    told = json.loads((folder / "verdict.explain.json").read_text(encoding="utf-8"))["response_check"]
    (spring,) = told["stiffnesses"]
    truth = Robot.load(str(folder.parents[1] / "plant.yaml")).parameter(spring["name"])
    assert spring["agree"]
    assert "compensate.friction" in told["method"]
    for way in ("by_responses", "by_torques"):
        one = spring[way]
        assert abs(one["estimate"] - truth) < 3 * one["standard_error"] < 0.015 * truth


def test_the_extended_robot_predicts_poses_that_the_diagnosis_did_not_see(folder: Path) -> None:
    """Torque and speed a hundred times nearer than with the robot file."""
    check = Diagnosis.read(folder / "artifacts" / "check.h5")
    errors = {(one.model, one.quantity): float(one.relative[0]) for one in check.errors}
    quantities = {quantity for _, quantity in errors}
    assert len(quantities) == 2
    for quantity in quantities:
        assert errors["extended robot", quantity] < 0.01 * errors["robot file", quantity]


def test_in_closed_loop_the_extended_robot_is_as_near_as_the_plant_itself(folder: Path) -> None:
    """Under the recorded references the plant repeats its record but for the encoder; told values are far off."""
    explain = Diagnosis.read(folder / "artifacts" / "explain.h5")
    record = Record.read(folder / "artifacts" / "acquire.h5")
    moving = {
        one.model: float(one.relative[0])
        for one in explain.errors
        if one.quantity.startswith("speed in closed")
    }
    told, refitted, extended = moving.values()
    assert list(moving) == ["robot file", "robot file, values refitted", "extended robot"]
    again = simulate_record(Robot.load(str(folder.parents[1] / "plant.yaml")), record, "motion")
    run = record.run

    def below(measured: np.ndarray) -> np.ndarray:
        spectrum = np.fft.rfft(np.gradient(measured, run.sample_time_s, axis=1), axis=1)
        return spectrum[:, : int(100 * measured.shape[1] * run.sample_time_s)]

    measured, simulated = (below(one.run.lanes("motor_position")) for one in (record, again))
    floor = np.linalg.norm(measured - simulated) / np.linalg.norm(measured)
    # The low-pass is softer than a cut at 100 Hz, and noise of a speed grows with frequency.
    assert extended == pytest.approx(floor, rel=0.3)
    assert told > 5 * refitted > 100 * extended


def test_the_page_shows_the_cause_and_a_picture(folder: Path) -> None:
    """Dots of the residual follow the law's line: the picture's values agree within a tenth of their range."""
    page = (folder / "artifacts" / "page.html").read_text(encoding="utf-8")
    assert "Cause: friction.load_dependent, axis_1 (motor)" in page
    assert '<svg viewBox="0 0 560 254" class="cause"' in page
    (finding,) = Diagnosis.read(folder / "artifacts" / "explain.h5").findings
    assert finding.variable.startswith("size of the load")
    assert finding.residual is not None
    assert finding.explained is not None
    off = np.abs(finding.residual - finding.explained).max()
    assert off < 0.1 * np.ptp(finding.explained)
