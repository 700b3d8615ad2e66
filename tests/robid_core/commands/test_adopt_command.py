"""`robid adopt`: the fit goes into the user's robot file, or the file stays as it is and the reason is told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, NotTrustworthy, Robot, StoreError
from robid_core.commands.adopt import adopt
from robid_core.pipeline import Pipeline
from robid_core.run import RunOptions, run_pipeline

ROBOT = "# Mine.\nrobid_robot: 1\nbase: one_axis\nparameters:\n  gear_stiffness.axis_1: 7.0e+4   # guessed\n"
TEXT = """\
robid: 1
name: exact
seed: 3
robot: robot.yaml
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where:   {use: design.candidates, with: {count: 2}}
  excite:  {use: excitation.multisine, with: {band_hz: [4, 80], lines: 20, period_s: 2, blocks: 2, slow_sine_rad_s: 9}}
  acquire: {use: acquisition.drives, with: {periods: 1, settle_periods: 1}}
  frf:     {use: frf.log}
  fit:     {use: fit.log_response, with: {starts: 1}}
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    folder = tmp_path_factory.mktemp("adopt")
    (folder / "robot.yaml").write_text(ROBOT)
    (folder / "pipeline.yaml").write_text(TEXT)
    pipeline = Pipeline.load(folder / "pipeline.yaml")
    run_pipeline(pipeline, RunOptions(jobs=1))
    return pipeline


@pytest.fixture
def pipeline(finished: Pipeline) -> Iterator[Pipeline]:
    """The run is made; its robot file is as it was before."""
    file = finished.folder / "robot.yaml"
    file.write_text(ROBOT)
    yield finished
    file.write_text(ROBOT)


def test_the_numbers_change_and_the_comments_stay(pipeline: Pipeline) -> None:
    file = pipeline.folder / "robot.yaml"
    run = pipeline.folder / "runs" / "exact"
    found = Robot.load(str(run / "robot.fit.yaml"))
    predicted = adopt(pipeline, "fit", dry_run=True)
    assert file.read_text() == ROBOT
    assert adopt(pipeline, "fit") == predicted
    assert Robot.load(str(file)) == found
    text = file.read_text()
    assert text.startswith("# Mine.\nrobid_robot: 1\nbase: one_axis\nparameters:\n  gear_stiffness.axis_1: 5")
    assert "   # guessed\n" in text
    assert [line for line in predicted if line.startswith("-  ")] == [
        "-  gear_stiffness.axis_1: 7.0e+4   # guessed"
    ]
    assert np.isclose(found.parameter("gear_stiffness.axis_1"), 5.6e4, rtol=0.05)
    assert list(file.parent.glob("robot.yaml.*")) == []


def test_once_adopted_the_fit_is_of_another_robot(pipeline: Pipeline) -> None:
    adopt(pipeline, "fit")
    with pytest.raises(
        ConfigurationError, match="has changed since the fit was made from it; run the pipeline again"
    ):
        adopt(pipeline, "fit")


def test_a_stage_without_a_robot_is_told(pipeline: Pipeline) -> None:
    with pytest.raises(ConfigurationError, match="stage 'frf': its Frf holds no robot; name a fit"):
        adopt(pipeline, "frf")
    with pytest.raises(ConfigurationError, match="has no stage 'fitt'; did you mean 'fit'"):
        adopt(pipeline, "fitt")


def test_a_packaged_robot_stays_as_it_is(finished: Pipeline, tmp_path: Path) -> None:
    file = finished.folder / "packaged.yaml"
    file.write_text(TEXT.replace("robot: robot.yaml", "robot: one_axis"))
    with pytest.raises(
        ConfigurationError, match=r"one_axis comes with robid and stays as it is; take .*robot.fit.yaml"
    ):
        adopt(Pipeline.load(file), "fit")


def test_without_a_run_there_is_nothing_to_adopt(pipeline: Pipeline) -> None:
    file = pipeline.folder / "other.yaml"
    file.write_text(TEXT.replace("name: exact", "name: other"))
    with pytest.raises(ConfigurationError, match="run the pipeline first"):
        adopt(Pipeline.load(file), "fit")


def test_a_fit_that_did_not_converge_is_not_adopted(pipeline: Pipeline) -> None:
    file = pipeline.folder / "short.yaml"
    file.write_text(
        TEXT.replace("name: exact", "name: short").replace("{starts: 1}", "{starts: 1, max_iterations: 1}")
    )
    short = Pipeline.load(file)
    run_pipeline(short, RunOptions(jobs=1))
    with pytest.raises(NotTrustworthy, match="stage fit: the fit must not be used"):
        adopt(short, "fit")


def test_a_file_that_cannot_be_written_stays_as_it_was(
    pipeline: Pipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(StoreError, match="No space left on device; the file is as it was"):
        adopt(pipeline, "fit")
    assert (pipeline.folder / "robot.yaml").read_text() == ROBOT
