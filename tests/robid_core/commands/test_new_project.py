"""The project that `robid init` makes ends without doubt: it is the first thing that a stranger sees."""

from pathlib import Path

import pytest
from oracles.robots import changed

from robid_core.artifacts import Excitation, Fit
from robid_core.commands.init import configurations_for, files_of_urdf, project_files
from robid_core.errors import ConfigurationError, MotionRefused
from robid_core.pipeline import Pipeline
from robid_core.robot import Robot
from robid_core.run import RunOptions, run_pipeline

UNTIL_EXCITE = RunOptions(jobs=1, last="excite")


@pytest.mark.parametrize("settings", [("seed=1",), ("seed=2", "stages.excite.with.torque_share=0.1")])
def test_a_new_project_ends_without_doubt_and_finds_the_plants_spring(
    tmp_path: Path, settings: tuple[str, ...]
) -> None:
    """Five standard errors: a chance of 6e-7 by a normal law."""
    for name, text in project_files(tmp_path, "one_axis", own_robot=False).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = run_pipeline(Pipeline.load(tmp_path / "pipeline.yaml", settings), RunOptions(jobs=1, last="fit"))
    assert done.doubts == ()
    assert done.exit_code == 0
    table = Fit.read(done.folder.path / done.manifest.stages["fit"].file).parameters
    spring, true = "gear_stiffness.axis_1", Robot.load("one_axis_true").parameter("gear_stiffness.axis_1")
    error = table.standard_error[table.names.index(spring)]
    assert abs(table.value(spring) - true) < 5 * error
    assert error < 1e-3 * true


def test_a_urdf_that_is_not_there_is_named_as_it_was_given(tmp_path: Path) -> None:
    """No robot file is at hand yet to which a path would be relative."""
    with pytest.raises(ConfigurationError) as told:
        files_of_urdf(tmp_path, tmp_path / "nope.urdf", ())
    assert str(told.value).startswith(f"--robot {tmp_path / 'nope.urdf'}: there is no such file")
    assert "in a robot file" not in str(told.value)


def test_configurations_suffice_for_the_springs() -> None:
    assert [configurations_for(n) for n in (0, 1, 6, 7, 11, 13)] == [2, 2, 2, 3, 4, 5]


def test_a_new_project_around_a_six_axis_urdf_is_within_its_limits_as_written(tmp_path: Path) -> None:
    """A light wrist behind a small gear reaches its limit of speed first: a quarter of its torque would be refused."""
    urdf = tmp_path / "arm.urdf"
    plain = changed(Robot.load("universal_arm"), bearings={}, every_axis={"gear": None})
    urdf.write_text(plain.to_urdf())
    project = tmp_path / "project"
    project.mkdir()
    files, _, _ = files_of_urdf(project, urdf, ())
    for name, text in files.items():
        for key, value in {"torque_constant": 1.0, "speed_gain": 0.01, "integral_gain": 0.08}.items():
            text = text.replace(f"{key}: fill_in", f"{key}: {value}")
        (project / name).write_text(text, encoding="utf-8")
    robot = (project / "robot.yaml").read_text()
    (project / "robot.yaml").write_text(robot.replace("  axis_6:\n", "  axis_6:\n    speed_limit: 40\n"))
    pipeline = project / "pipeline.yaml"
    with pytest.raises(MotionRefused, match="axis_6 would reach a motor speed"):
        run_pipeline(Pipeline.load(pipeline, ("stages.excite.with.beyond_limits=refuse",)), UNTIL_EXCITE)
    done = run_pipeline(Pipeline.load(pipeline), UNTIL_EXCITE)
    made = Excitation.read(done.folder.path / done.manifest.stages["excite"].file)
    assert made.predicted_speed[:, 5].max() <= 0.9 * 40
    assert made.n_config == 4
