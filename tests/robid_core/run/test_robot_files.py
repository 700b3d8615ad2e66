"""What a run found is a robot file in its folder: it loads as the fitted robot, and goes where the fit is no good."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Diagnosis, Fit, Robot
from robid_core.pipeline import Pipeline

HEAD = "robid: 1\nname: strange\nseed: 7\nrobot: one_axis\nstages:\n"
IDENTIFY = "  identify: {use: strange.identify}\n"
OWN = "# My robot.\nrobid_robot: 1\nname: mine\nbase: one_axis\nparameters: {mass.axis_1: 41.0}  # weighed\n"


def begin(world: Any, stages: str = IDENTIFY, robot: str = "one_axis") -> None:
    world.file.write_text(HEAD.replace("one_axis", robot) + stages)


def test_the_robot_of_a_fit_is_a_file_that_loads_equal(world: Any) -> None:
    begin(world)
    world.run()
    path = world.folder / "robot.identify.yaml"
    fit = Fit.read(world.folder / "artifacts" / "identify.h5")
    assert fit.model is not None
    expected = Robot.load("one_axis").with_parameters({"gear_stiffness.axis_1": 6e4})
    assert Robot.load(str(path)) == Robot.of_model(fit.model) == expected
    text = path.read_text()
    assert text.startswith(
        "# What stage 'identify' of strange found; robid run keeps this file up to date.\n"
    )
    assert "\n# strange: converged\n" in text
    assert "\nbase: one_axis\n" in text
    written = path.stat().st_mtime_ns
    world.run()
    assert path.stat().st_mtime_ns == written
    path.unlink()
    world.run()  # the fit is kept, its file comes back
    assert path.read_text() == text


def test_the_file_refers_to_the_users_robot_from_the_runs_folder(world: Any) -> None:
    (world.project / "robot.yaml").write_text(OWN)
    begin(world, robot="robot.yaml")
    world.run()
    path = world.folder / "robot.identify.yaml"
    assert "\nbase: ../../robot.yaml\n" in path.read_text()
    found = Robot.load(str(path))
    assert (found.name, found.parameter("mass.axis_1"), found.parameter("gear_stiffness.axis_1")) == (
        "mine",
        41.0,
        6e4,
    )
    (world.project / "robot.yaml").write_text(OWN.replace("41.0", "42.0"))
    with pytest.raises(
        ConfigurationError, match="base_sha256: mine has changed since this file was made from it"
    ):
        Robot.load(str(path))
    world.run()
    assert Robot.load(str(path)).parameter("mass.axis_1") == 42.0


def test_a_fit_that_did_not_converge_leaves_no_robot_file(world: Any) -> None:
    begin(world)
    world.run()
    assert (world.folder / "robot.identify.yaml").exists()
    world.run("stages.identify.with.converged=false")
    assert not (world.folder / "robot.identify.yaml").exists()


def test_a_refused_stage_leaves_no_robot_file(world: Any) -> None:
    begin(world, IDENTIFY + "  again: {use: strange.identify, inputs: {robot: identify}}\n")
    world.run()
    assert (world.folder / "robot.again.yaml").exists()
    world.run("stages.identify.with.converged=false")
    assert not (world.folder / "robot.again.yaml").exists()


def test_the_robot_of_a_diagnosis_has_its_effect_and_the_numbers_of_the_fit(world: Any) -> None:
    begin(
        world,
        IDENTIFY
        + "  explain: {use: strange.explain}\n  told: {use: strange.tell, inputs: {robot: explain}}\n",
    )
    result = world.run()
    assert set(result.manifest.stages["told"].ingredients["robot"]["effects"]) == {"drive.torque_ripple"}
    found = Robot.load(str(world.folder / "robot.explain.yaml"))
    diagnosis = Diagnosis.read(world.folder / "artifacts" / "explain.h5")
    assert diagnosis.model is not None
    assert found == Robot.of_model(diagnosis.model)
    assert found.parameter("gear_stiffness.axis_1") == 6e4
    assert found.parameter("effect.ripple.amplitude") == 0.1
    reference = 20 * np.sin(2 * np.pi * 5 * np.arange(100) * 0.001)[None, :, None]
    ours, nominal = (r.simulate(reference, np.array([[0.3]])).torque for r in (found, Robot.load("one_axis")))
    assert np.abs(ours - nominal).max() > 1e-2


def test_another_pipeline_takes_it_as_nominal_and_its_own_does_not(world: Any) -> None:
    begin(world)
    world.run()
    tell = "  told: {use: strange.tell}\n"
    other = world.project / "other.yaml"
    text = HEAD.replace("strange", "other").replace("one_axis", "runs/strange/robot.identify.yaml") + tell
    other.write_text(text)
    robot = Pipeline.load(other, plugins=world.registry()).robot.load()
    assert robot.parameter("gear_stiffness.axis_1") == 6e4
    begin(world, robot="runs/strange/robot.identify.yaml")
    with pytest.raises(
        ConfigurationError, match=r"robot: runs/strange/robot.identify.yaml is what stage 'identify'"
    ):
        world.run()


def test_a_model_of_another_base_is_written_whole(world: Any, tmp_path: Path) -> None:
    """A stranger's fit may change what has no name: then there is no short way to write its robot."""
    world.edit(
        "        model = robot.model({names[0]",
        "        slower = robot.description.axes['axis_1'].model_copy(update={'speed_limit': 300.0})\n"
        "        changed = robot.description.model_copy(update={'axes': {'axis_1': slower}})\n"
        "        robot = dataclasses.replace(robot, description=changed)\n"
        "        model = robot.model({names[0]",
    )
    begin(world)
    world.run()
    text = (world.folder / "robot.identify.yaml").read_text()
    assert text.startswith("# What stage 'identify' of strange found")
    assert "base:" not in text
    found = Robot.load(str(world.folder / "robot.identify.yaml"))
    assert found.drives.speed_limit.tolist() == [300.0]
    assert found.parameter("gear_stiffness.axis_1") == 6e4


def test_the_file_tells_why_its_numbers_should_be_doubted(world: Any) -> None:
    begin(world)
    world.run()
    assert "# Doubt" not in (world.folder / "robot.identify.yaml").read_text()
    world.run("stages.identify.with.misfit=1.5")
    text = (world.folder / "robot.identify.yaml").read_text()
    fit = Fit.read(world.folder / "artifacts" / "identify.h5")
    assert [f"# Doubt: {doubt}" for doubt in fit.doubts] == [
        x for x in text.splitlines() if x.startswith("# Doubt")
    ]
    assert "misfit" in text
    assert Robot.load(str(world.folder / "robot.identify.yaml")).parameter("gear_stiffness.axis_1") == 6e4
