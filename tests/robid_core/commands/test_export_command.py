"""`robid export`, `robid init --robot URDF` and `robid doctor ROBOT` as a person calls them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
import scipy.io
import typer
from oracles.robots import changed

from robid_core import ConfigurationError, Fit, Robot
from robid_core.commands import doctor, export, init, validate
from robid_core.pipeline import Pipeline
from robid_core.robot.file.reading import find_robot
from robid_core.run import RunFolder, RunOptions, run_pipeline
from robid_pin.urdf import model_from_urdf

Told = Callable[[], str]
ONE_AXIS = """robid: 1
name: short
seed: 2
robot: one_axis
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where:   {use: design.candidates, with: {count: 2}}
  excite:  {use: excitation.multisine, with: {band_hz: [4, 60], lines: 20, period_s: 1, blocks: 2}}
  acquire: {use: acquisition.drives, with: {periods: 1, settle_periods: 1}}
  frf:     {use: frf.log}
  fit:     {use: fit.log_response, with: {starts: 1}}
"""


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    return lambda: capsys.readouterr().out


def filled(text: str, ratio: float, rotor: float, gain: float) -> str:
    """The draft with what a data sheet says."""
    values = {"gear_ratio": ratio, "rotor_inertia": rotor, "torque_constant": 1.0}
    for key, value in (values | {"speed_gain": gain, "integral_gain": 8 * gain}).items():
        text = text.replace(f"{key}: fill_in", f"{key}: {value}")
    return text


def test_the_ending_of_the_file_says_the_format(tmp_path: Path, told: Told) -> None:
    robot = Robot.load("scara")
    for name in ("a.yaml", "a.urdf", "a.xml", "a.mat", "a.npz", "a.csv", "a.json"):
        export.command("scara", tmp_path / name)
    lines = [line for line in told().splitlines() if not line.startswith("- ")]
    assert [line.split(" as ")[1].split()[0].rstrip(",") for line in lines] == [
        "robot", "urdf", "mjcf", "state_space", "state_space", "table", "table",
    ]  # fmt: skip
    assert Robot.load("a.yaml", tmp_path).sha256 == robot.sha256
    assert model_from_urdf(tmp_path / "a.urdf").chain.mass.sum() == robot.chain.mass.sum()
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml")).nu == 4
    np.testing.assert_array_equal(scipy.io.loadmat(tmp_path / "a.mat")["A"], np.load(tmp_path / "a.npz")["A"])


def test_a_state_space_is_that_of_the_configuration_asked_for(tmp_path: Path, told: Told) -> None:
    export.command("one_axis", tmp_path / "a.npz", at="0.4", outputs="arm_angle, motor_acceleration")
    assert "at (0.4), continuous time" in told()
    read, robot = np.load(tmp_path / "a.npz"), Robot.load("one_axis")
    expected = robot.linearize(np.array([0.4]), ("arm_angle", "motor_acceleration"))
    np.testing.assert_array_equal(read["C"], expected.c)
    np.testing.assert_array_equal(read["A"], expected.a)


def test_a_runs_robot_has_its_covariance(tmp_path: Path, told: Told) -> None:
    (tmp_path / "pipeline.yaml").write_text(ONE_AXIS)
    pipeline = Pipeline.load(tmp_path / "pipeline.yaml")
    result = run_pipeline(pipeline)
    folder = RunFolder.of(pipeline)
    export.command(str(folder.robot("fit")), tmp_path / "fit.json")
    assert "estimated" in told()
    table = json.loads((tmp_path / "fit.json").read_text())
    fit = Fit.read(folder.path / str(result.manifest.stages["fit"].file))
    assert fit.model is not None
    assert table["covariance"]["names"] == list(fit.model.free_names)
    np.testing.assert_array_equal(table["covariance"]["matrix"], fit.model.covariance)
    rows = {row["name"]: row for row in table["parameters"]}
    spring = "gear_stiffness.axis_1"
    assert rows[spring]["value"] == fit.parameters.value(spring)
    assert rows[spring]["standard_error"] == pytest.approx(fit.model.standard_errors()[spring])
    path = folder.robot("fit")
    path.write_text(path.read_text() + "  mass.axis_1: 41\n")
    with pytest.raises(ConfigurationError, match="other numbers than stage 'fit' found"):
        export.command(str(path), tmp_path / "other.json")


def test_effects_that_a_format_cannot_hold_are_told(tmp_path: Path, told: Told) -> None:
    (tmp_path / "robot.yaml").write_text(
        "robid_robot: 1\nbase: one_axis\neffects: {grease: {use: friction.stribeck, on: axis_1}}\n"
    )
    export.command(str(tmp_path / "robot.yaml"), tmp_path / "a.xml")
    screen = told()
    assert (
        "- fixed links (flange, tool) are part of the link that carries them; meshes are not written"
        in screen
    )
    assert "- mjcf has no place for effects, left out: grease" in screen


@pytest.mark.parametrize(
    ("out", "options", "message"),
    [
        ("a.txt", {}, "the ending says no format; end it with one of .yaml"),
        ("a.mat", {"to": "mat"}, "--to mat: no such format"),
        ("a.mat", {"to": "urdf"}, "a file of urdf ends with .urdf"),
        ("a.urdf", {"at": "0"}, "--at and --outputs are for state_space"),
        ("a.mat", {"at": "x"}, "--at x: give 1 numbers with commas"),
        ("a.mat", {"at": "90"}, "--at 90: 90 is beyond the limits of axis_1, .* degrees"),
        ("there.mat", {}, "is there already"),
    ],
)
def test_what_cannot_be_exported_is_told(
    tmp_path: Path, out: str, options: dict[str, str], message: str
) -> None:
    (tmp_path / "there.mat").touch()
    with pytest.raises(ConfigurationError, match=message):
        export.command("one_axis", tmp_path / out, **options)  # type: ignore[arg-type]
    export.command("one_axis", tmp_path / "there.mat", overwrite=True)


def test_a_project_around_a_urdf_waits_and_then_holds(tmp_path: Path, told: Told) -> None:
    """A UR-like arm as URDF: the bearing on the line of axis 2 is not proposed, and remarked where it is added.

    Gear ratios and rotors stand in the file that robid wrote; torque constants and controllers wait.
    """
    urdf = tmp_path / "arm.urdf"
    plain = changed(Robot.load("universal_arm"), bearings={}, every_axis={"gear": None})
    urdf.write_text(plain.to_urdf())
    project = tmp_path / "project"
    init.command(project, str(urdf))
    lines = told().splitlines()
    assert lines[0] == f"{project}: pipeline.yaml, README.md, robot.yaml, plant.yaml, arm.urdf"
    assert "- no bearing 'axis_1_z': the line of axis_2, whose gear would be the same spring" in lines
    assert lines[-1].startswith(f"next: cd {project}, fill in the 18 values that robid validate lists")
    with pytest.raises(ConfigurationError) as refused:
        validate.command(project / "pipeline.yaml")
    assert str(refused.value).count("still to fill in: a number") == 18
    text = (project / "robot.yaml").read_text()
    text = filled(text, 101, 1e-4, 0.008)
    spring = "  tilt: {joint: axis_1, axis: [0, 0, 1], stiffness: 9.0e+4, damping: 30}\n"
    (project / "robot.yaml").write_text(text + spring)
    validate.command(project / "pipeline.yaml")
    first, last = told().splitlines()
    assert "robot: remark: bearing_stiffness.tilt and gear_stiffness.axis_2 turn about one line" in first
    assert last.endswith("valid, 6 stages")
    doctor.command(str(project / "robot.yaml"))
    assert "note robot.yaml:6:1: bearing_stiffness.tilt and " in told()
    with pytest.raises(ConfigurationError, match="would be overwritten"):
        init.command(project, str(urdf))


def test_a_filled_in_draft_runs_on_its_simulated_drives(tmp_path: Path, told: Told) -> None:
    """The springs of the simulated machine, a quarter softer than proposed, are found."""
    plain = changed(Robot.load("one_axis"), every_axis={"gear": None})
    (tmp_path / "arm.urdf").write_text(plain.to_urdf())
    init.command(tmp_path / "project", str(tmp_path / "arm.urdf"))
    path = tmp_path / "project" / "robot.yaml"
    text = path.read_text()
    path.write_text(filled(text, 100, 1.2e-3, 0.08))
    settings = ("stages.excite.with.period_s=1", "stages.excite.with.lines=20", "stages.fit.with.starts=1")
    result = run_pipeline(Pipeline.load(tmp_path / "project" / "pipeline.yaml", settings))
    fit = Fit.read(result.folder.path / str(result.manifest.stages["fit"].file))
    truth = Robot.load("plant.yaml", tmp_path / "project")
    assert fit.converged
    for spring in truth.stiffness_names:
        assert fit.parameters.value(spring) == pytest.approx(truth.parameter(spring), rel=0.01)


def test_doctor_leaves_with_2_where_a_robot_cannot_be(tmp_path: Path, told: Told) -> None:
    doctor.command("scara")
    assert told() == "scara: 4 axes, nothing implausible\n"
    text = find_robot("one_axis").read_text()
    (tmp_path / "robot.yaml").write_text(text.replace("[-2.0, 2.0]", "[-170, 170]"))
    with pytest.raises(typer.Exit) as left:
        doctor.command(str(tmp_path / "robot.yaml"))
    assert left.value.exit_code == 2
    assert "FAIL robot.yaml:13:5: axes.axis_1.position_limits: 170 rad are 27.1 turns; degrees?" in told()


@pytest.mark.parametrize("name", ["universal_arm", "seven_axis", "scara"])
def test_a_new_project_around_a_packaged_arm_stays_within_its_limits(name: str, tmp_path: Path) -> None:
    init.command(tmp_path / "project", name)
    pipeline = Pipeline.load(tmp_path / "project" / "pipeline.yaml")
    result = run_pipeline(pipeline, RunOptions(last="excite"))
    assert result.outcomes == {"where": "made", "excite": "made"}


def test_a_urdf_is_no_packaged_robot(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--lock is for joints of a URDF; scara is none"):
        init.command(tmp_path / "project", "scara", lock=["axis_1"])
    with pytest.raises(ConfigurationError, match="--own-robot copies a packaged robot"):
        init.command(tmp_path / "project", "arm.urdf", own_robot=True)
