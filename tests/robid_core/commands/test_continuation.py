"""`robid diagnose --continue`: which drives may measure, which stages do it, and what comes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robid_core import Diagnosis, Finding, SeparatingExperiment
from robid_core.commands import main
from robid_core.commands.continuation import AGAIN, drives_of, experiment_of
from robid_core.commands.diagnose import FILE, Asked, pipeline_text
from robid_core.errors import MotionRefused
from robid_core.pipeline import Pipeline

EXPERIMENT = SeparatingExperiment(
    rivals=("load.counterbalance at axis_1 (arm)",),
    amplitude=2.0,
    duration_s=12.0,
    n_period=2,
    n_settling=1,
    difference="",
    configuration=np.array([-1.0]),
    reference=np.zeros((4000, 1)),
    ratio=np.array([3.0]),
    repeat=np.array([0.1]),
    line=np.array([17, 19]),
)
PLANT = """robid_robot: 1
name: plant
base: one_axis_true
effects:
  hose: {use: load.cable_spring, on: axis_1, with: {stiffness: 10, damping: 0}}
"""
MEASURED = """robid: 1
name: lab
seed: 5
robot: one_axis
drives: {use: simulated, with: {plant: plant.yaml}}
stages:
  where:   {use: design.candidates, with: {count: 2}}
  excite:  {use: excitation.multisine, inputs: {configurations: where},
            with: {band_hz: [4, 80], lines: 60, period_s: 4, blocks: 2, slow_sine_rad_s: 9}}
  acquire: {use: acquisition.drives, inputs: {configurations: where, excitation: excite}}
"""


def finding(separation: SeparatingExperiment | None) -> Finding:
    none = np.empty(0)
    return Finding(
        "cause", "load.cable_spring", "axis_1", "arm", 50.0, 1e-9, 1.0, (), (), none, none, none, none, none, none,
        separation=separation,
    )  # fmt: skip


def test_drives_that_move_hardware_are_refused_in_one_sentence(tmp_path: Path) -> None:
    text = MEASURED.replace(
        "{use: simulated, with: {plant: plant.yaml}}", "{use: can, with: {interface: socketcan}}"
    )
    (tmp_path / "lab.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(MotionRefused, match="measures on simulated drives only"):
        drives_of(tmp_path / "lab.yaml")


def test_what_was_simulated_elsewhere_is_simulated_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stages that measure are a valid pipeline, and all records are judged again."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "plant.yaml").write_text(PLANT, encoding="utf-8")
    (tmp_path / "lab" / "lab.yaml").write_text(MEASURED, encoding="utf-8")
    (tmp_path / "a.mcap").write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    drives = drives_of(Path("lab/lab.yaml"))
    assert drives == {"use": "simulated", "with": {"plant": "lab/plant.yaml"}}
    text = pipeline_text("one_axis", [{"path": "a.mcap"}], Asked(), drives, EXPERIMENT)
    (tmp_path / FILE).write_text(text, encoding="utf-8")
    pipeline = Pipeline.load(tmp_path / FILE, data_root=tmp_path)
    assert tuple(pipeline.stage(AGAIN).inputs["record"]) == ("record_1", "measure_next")
    measure = pipeline.stage("measure_next").stage
    assert (measure.periods, measure.settle_periods) == (2, 1)  # type: ignore[attr-defined]


def test_only_what_separates_is_measured() -> None:
    weak = EXPERIMENT.replace(ratio=np.array([0.5]))
    assert experiment_of(Diagnosis("effects", "", findings=(finding(None), finding(weak)))) is None
    found = experiment_of(Diagnosis("effects", "", findings=(finding(weak), finding(EXPERIMENT))))
    assert found is EXPERIMENT


@pytest.mark.full
def test_a_tie_is_measured_and_judged_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hose of simulated drives is tied with a counterbalance; after the experiment that was proposed it is not."""
    monkeypatch.chdir(tmp_path)
    Path("plant.yaml").write_text(PLANT, encoding="utf-8")
    Path("lab.yaml").write_text(MEASURED, encoding="utf-8")
    only = ("--only", "load.cable_spring", "--only", "load.counterbalance")
    again = ("--continue", "lab.yaml", "runs/lab/raw/acquire.mcap")
    for words in (("run", "lab.yaml", "-q"), ("diagnose", "--robot", "one_axis", *only, *again, "-q")):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert not ended.value.code
    before, after = (
        Diagnosis.read(Path(f"runs/diagnosis/artifacts/{stage}.h5")).findings for stage in ("explain", AGAIN)
    )
    assert [one.effect for one in (*before, *after)] == ["load.cable_spring"] * 2
    assert before[0].ties == ("load.counterbalance at axis_1 (arm)",)
    assert after[0].ties == ()
