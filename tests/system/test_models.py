"""One axis from recording to a model that other stages take as their robot, by built-in stages alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robid_core import Design, Fit, Record, Robot

pytestmark = pytest.mark.system

PIPELINE = """\
robid: 1
name: two
seed: 1
robot: mine.yaml
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where:   {use: design.candidates, with: {count: 2}}
  excite:  {use: excitation.multisine, with: {band_hz: [4, 80], lines: 30, period_s: 2, blocks: 2, slow_sine_rad_s: 9}}
  acquire: {use: acquisition.drives, inputs: {configurations: where}, with: {periods: 2, settle_periods: 1}}
  frf:     {use: frf.log, inputs: {record: acquire}}
  fit:     {use: fit.log_response, with: {starts: 2}}
  torque:  {use: fit.torque_residual, inputs: {record: acquire, robot: fit}, with: {free: ["gear_*", "*.viscous"]}}
  still:   {use: compensate.simulation, inputs: {record: acquire, robot: torque, fit: torque}, with: {realizations: 2}}
  choose:  {use: design.optimal, inputs: {robot: torque, fit: torque}, with: {candidates: 10, experiments: 2}}
"""


def test_fits_build_on_one_another_and_the_run_leaves_robots(tmp_path: Path, robid) -> None:
    (tmp_path / "mine.yaml").write_text("robid_robot: 1\nname: mine\nbase: one_axis  # as delivered\n")
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    told = robid(tmp_path, "run")
    assert told.code == 0, told.err
    run = tmp_path / "runs" / "two"
    assert "robot      runs/two/robot.torque.yaml" in told.out
    nominal, true = Robot.load("mine.yaml", tmp_path), Robot.load("one_axis_true")
    first, second = (Fit.read(run / "artifacts" / f"{name}.h5") for name in ("fit", "torque"))
    assert first.model is not None
    assert second.model is not None
    assert first.model.base_sha256 == second.model.base_sha256 == nominal.sha256
    began = dict(zip(second.model.names, second.model.start, strict=True))
    assert began["gear_stiffness.axis_1"] == first.parameters.value("gear_stiffness.axis_1")
    found = Robot.load("robot.torque.yaml", run)
    assert found == Robot.of_model(second.model)
    lines = (run / "robot.torque.yaml").read_text().splitlines()
    assert "base: ../../mine.yaml" in lines
    # The found robot moves as the plant does, the nominal one does not.
    time = np.arange(1000) * 0.001
    reference = (30 * np.sin(2 * np.pi * 8 * time))[None, :, None]
    ours, theirs, right = (r.simulate(reference, np.array([[0.4]])).torque for r in (found, nominal, true))
    size = np.abs(right).max()
    assert np.abs(ours - right).max() < 0.05 * size < 0.1 * size < np.abs(theirs - right).max()
    assert Design.read(run / "artifacts" / "choose.h5").parameter_names == ("gear_stiffness.axis_1",)
    assert Record.read(run / "artifacts" / "still.h5").model_based
    again = robid(tmp_path, "run")
    assert "nothing to do" in again.out
    adopted = robid(tmp_path, "adopt", "torque")
    assert adopted.code == 0, adopted.err
    assert Robot.load("mine.yaml", tmp_path) == found
    assert "base: one_axis  # as delivered\n" in (tmp_path / "mine.yaml").read_text()
