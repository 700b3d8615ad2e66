"""Warnings that say the same of several recordings: one sentence for people, on every screen and on the page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from robid_core.artifacts import Report
from robid_core.commands.last_screen import last_screen
from robid_core.commands.show import run_lines
from robid_core.pipeline import Pipeline
from robid_core.run import RunOptions, run_pipeline
from robid_core.run.folded import folded

AXIS = {"rotor_inertia": 1e-3, "torque_limit": 10.0, "speed_limit": 100.0, "controller": {"speed_gain": 0.1}}


def test_sentences_that_differ_in_names_and_numbers_become_one() -> None:
    said = "off by up to {} % ({} % rms)"
    five = [f"stage record_{i}: run_{i}.csv: {said.format(8 + i / 10, 2)}" for i in (3, 1, 2, 5, 4)]
    assert folded([*five, "stage explain: no torque_limit of joint_1"]) == [
        "stage record_3 to record_4: 5 files (run_3.csv to run_4.csv): off by up to 8.5 % (2 % rms)".replace(
            "stage", "stages", 1
        ),
        "stage explain: no torque_limit of joint_1",
    ]


def test_what_names_another_axis_or_says_something_else_stays_apart() -> None:
    texts = [
        "stage a: x.csv: axis_1 is constant",
        "stage b: y.csv: axis_2 is constant",
        "stage c: z.csv: axis_2 is 4 mm off",
        "not of a stage",
    ]
    assert folded(texts) == texts


def test_files_of_one_stage_are_folded_too() -> None:
    texts = [f"stage a: {name}: step {value} s" for name, value in (("x.csv", 2), ("y.csv", 1.5))]
    assert folded(texts) == ["stage a: 2 files (x.csv, y.csv): step 1.5 to 2 s"]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Two recordings whose stamps jitter, one page of both."""
    robot = {"robid_robot": 1, "name": "bench", "bodies": [{"joint": "axis_1", "mass": 1.0}]}
    axes = {"axes": {"axis_1": {**AXIS, "gear_ratio": 10.0}}}
    (tmp_path / "robot.yaml").write_text(json.dumps(robot | axes))
    for i in (1, 2):
        time = 1e-3 * (np.arange(2000) + np.random.default_rng(i).uniform(-0.02, 0.02, 2000))
        np.savez(tmp_path / f"run_{i}.npz", t=time, q=np.sin(9 * time) * i)
    stages = {
        f"record_{i}": {
            "use": "acquisition.recorded",
            "with": {
                "path": f"run_{i}.npz",
                "time_column": "t",
                "channels": {"motor_position": {"column": "q", "unit": "rad"}},
            },
        }
        for i in (1, 2)
    }
    stages["page"] = {"use": "report.html", "inputs": {"record": "record_2"}}
    pipeline = {"robid": 1, "name": "lab", "seed": 1, "robot": "robot.yaml", "stages": stages}
    (tmp_path / "pipeline.yaml").write_text(json.dumps(pipeline))
    return tmp_path


def test_the_page_prints_the_runs_name_and_what_the_stages_behind_it_warned_of(project: Path) -> None:
    pipeline = Pipeline.load(project / "pipeline.yaml", data_root=project)
    done = run_pipeline(pipeline, RunOptions(jobs=1))
    assert len(done.warnings) == 2
    page = Report.read(done.folder.path / done.manifest.stages["page"].file).html
    assert "<title>lab – robid</title>" in page
    assert page.count("taken as even") == 1  # of its own record, and of no other
    assert "Stage record_2: run_2.npz: steps of time differ" in page
    again = run_pipeline(Pipeline.load(project / "pipeline.yaml", data_root=project), RunOptions(jobs=1))
    assert again.outcomes["page"] == "kept"
    other = Pipeline.load(project / "pipeline.yaml", ("name=other",), data_root=project)
    renamed = run_pipeline(other, RunOptions(jobs=1))
    assert renamed.outcomes == {"record_1": "kept", "record_2": "kept", "page": "made"}
    told = Report.read(renamed.folder.path / renamed.manifest.stages["page"].file).html
    assert "<title>other – robid</title>" in told


def test_run_and_show_say_it_once(project: Path) -> None:
    pipeline = Pipeline.load(project / "pipeline.yaml", data_root=project)
    done = run_pipeline(pipeline, RunOptions(jobs=1))
    for lines in (last_screen(pipeline, done, "robid run"), run_lines(done.folder, done.manifest)):
        (line,) = [one for one in lines if "taken as even" in one]
        assert line.startswith("! stages record_1, record_2: 2 files (run_1.npz, run_2.npz): steps of time")
