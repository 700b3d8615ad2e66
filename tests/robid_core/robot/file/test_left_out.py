"""What recordings do not need may be left out of a robot file; what needs it says so, and nothing moves then."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from robid_acquisition.drives import DriveAcquisition
from robid_core import ConfigurationError, MotionRefused, Robot
from robid_core.pipeline import Pipeline
from robid_core.yaml_file.problems import FileProblems

ROBOT = """\
robid_robot: 1
name: bare
sample_time_s: {sample_time}
bodies:
  - {{joint: shoulder, axis: [0, 1, 0], mass: 30, centre_of_mass: [0, 0, 0.3]}}
  - {{joint: elbow, parent: shoulder, axis: [0, 1, 0], translation: [0, 0, 0.5], mass: 12, centre_of_mass: [0, 0, 0.2]}}
axes:
  shoulder: {{gear_ratio: 100, rotor_inertia: 1.0e-3}}
  elbow: {{gear_ratio: -80, rotor_inertia: 5.0e-4, torque_limit: 10}}
"""


def bare(folder: Path, sample_time: float = 0.001, *more: tuple[str, str]) -> Robot:
    """Two axes: no speed limit and no controller, a torque limit for the elbow only."""
    text = ROBOT.format(sample_time=sample_time)
    for old, new in more:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "robot.yaml").write_text(text)
    return Robot.load("robot.yaml", folder)


def test_a_robot_file_may_leave_limits_and_controllers_out(tmp_path: Path) -> None:
    robot = bare(tmp_path)
    names = set(robot.parameters())
    assert {"torque_limit.elbow", "rotor_inertia.shoulder", "friction.shoulder.coulomb"} <= names
    assert not {name for name in names if name.startswith(("controller.", "torque_limit.shoulder"))}
    (tmp_path / "written.yaml").write_text(robot.to_yaml())
    assert Robot.load("written.yaml", tmp_path) == robot
    assert Robot.of_model(robot.model({"mass.elbow": 13.0})).parameter("mass.elbow") == 13.0


@pytest.mark.parametrize(
    ("key", "axes"),
    [
        ("torque_limit", "shoulder"), ("speed_limit", "shoulder, elbow"),
        ("speed_gain", "shoulder, elbow"), ("integral_gain", "shoulder, elbow"),
        ("position_gain", "shoulder, elbow"), ("speed_feedforward", "shoulder, elbow"),
    ],
)  # fmt: skip
def test_what_was_left_out_is_asked_for_by_key_and_axis(key: str, axes: str, tmp_path: Path) -> None:
    told = key if key.endswith("limit") else "controller"
    with pytest.raises(
        ConfigurationError,
        match=rf"^the robot file of bare lacks {told} of {axes} \(.+\); add it under axes$",
    ):
        getattr(bare(tmp_path).drives, key)


@pytest.mark.parametrize("key", ["torque_limit", "speed_limit"])
def test_nothing_is_cleared_to_move_without_limits(key: str, tmp_path: Path) -> None:
    """Told all but one limit of one axis: the gate's limits are refused with exit code 3, and never infinite."""
    limits = {"torque_limit": 20, "speed_limit": 400}
    del limits[key]
    written = ", ".join(f"{name}: {value}" for name, value in limits.items())
    robot = bare(
        tmp_path,
        0.001,
        ("rotor_inertia: 1.0e-3", f"rotor_inertia: 1.0e-3, {written}"),
        ("torque_limit: 10", "torque_limit: 10, speed_limit: 500"),
    )
    with pytest.raises(MotionRefused, match=rf"D03: .* lacks {key} of shoulder .*; nothing was sent") as told:
        _ = robot.limits
    assert told.value.exit_code == 3


def test_no_closed_loop_runs_without_a_controller(tmp_path: Path) -> None:
    robot = bare(tmp_path)
    with pytest.raises(ConfigurationError, match="lacks controller of shoulder, elbow"):
        robot.simulate(np.zeros((1, 4, 2)), np.zeros((1, 2)))
    with pytest.raises(ConfigurationError, match="lacks controller of shoulder, elbow"):
        robot.plant().rest(np.zeros(2))
    with pytest.raises(ConfigurationError, match="lacks torque_limit of shoulder"):
        robot.to_urdf()


def test_an_open_loop_needs_neither(tmp_path: Path) -> None:
    """Held by its gravity torque the arm stays where it is."""
    robot = bare(tmp_path)
    angle = np.array([[0.4, -0.7]])
    still = robot.drive(np.tile(robot.gravity_torque(angle)[:, None], (1, 50, 1)), angle)
    np.testing.assert_allclose(robot.joint_angle(still.position[0, -1]), angle[0], atol=1e-6)


@pytest.mark.parametrize(
    ("sample_time", "step"), [(0.001, 0.00025), (0.004, 0.00025), (0.0002, 0.0002), (0.0007, 0.0007 / 3)]
)
def test_a_step_that_is_left_out_divides_the_sample(sample_time: float, step: float, tmp_path: Path) -> None:
    assert bare(tmp_path, sample_time).step_s == pytest.approx(step, rel=1e-15)


PIPELINE = """\
robid: 1
name: needs
seed: 1
robot: robot.yaml
stages:
  where: {use: design.candidates, with: {count: 2}}
  excite: {use: excitation.multisine, with: {band_hz: [4, 40], lines: 20, period_s: 2}}
  acquire: {use: acquisition.simulated, with: {plant: one_axis_true}}
  smooth: {use: compensate.friction}
  frf: {use: frf.indirect, inputs: {record: smooth}}
  fit: {use: fit.log_response, with: {free: [rotor_inertia.*]}}
  explain: {use: diagnosis.effects, inputs: {record: acquire}, with: {closed_loop: true}}
"""
RECORDED = """\
robid: 1
name: recorded
seed: 1
robot: robot.yaml
stages:
  acquire:
    use: acquisition.recorded
    with:
      origin: nowhere
      path: a.csv
      sample_time_s: 0.001
      torque_hold: zero_order_hold
      channels: {motor_position: {column: [q1, q2], unit: rad}, motor_torque: {column: [u1, u2], unit: N m}}
  rigid: {use: fit.rigid}
  fit: {use: fit.torque_residual, with: {free: [mass.*]}}
  explain: {use: diagnosis.effects, inputs: {record: acquire}}
  simulate: {use: diagnosis.closed_loop, inputs: {fit: fit, explained: []}}
  predict: {use: diagnosis.prediction, inputs: {fit: fit, explained: explain}}
"""
NEEDS = {
    "where": "torque_limit of shoulder",
    "excite": "torque_limit of shoulder .* and speed_limit of shoulder, elbow .* and controller of shoulder, elbow",
    "acquire": "torque_limit of shoulder .* and speed_limit of shoulder, elbow",
    "smooth": "controller of shoulder, elbow",
    "frf": "controller of shoulder, elbow",
    "fit": "controller of shoulder, elbow",
    "explain": "torque_limit of shoulder .* and controller of shoulder, elbow",
}


def test_stages_that_need_more_say_so_before_anything_runs(tmp_path: Path) -> None:
    bare(tmp_path)
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    with pytest.raises(FileProblems) as refused:
        Pipeline.load(tmp_path / "pipeline.yaml")
    lines = [line for line in str(refused.value).splitlines() if "needs more of the robot" in line]
    assert len(lines) == len(NEEDS)
    for line, (stage, needed) in zip(lines, NEEDS.items(), strict=True):
        told = rf": stages\.{stage}: '\S+' \(robid .*\) needs more of the robot: the robot file of bare lacks {needed}"
        assert re.search(told, line), line


def test_recordings_and_their_diagnosis_ask_for_nothing(tmp_path: Path) -> None:
    bare(tmp_path)
    (tmp_path / "a.csv").write_text("q1,q2,u1,u2\n" + "0,0,0,0\n" * 10)
    (tmp_path / "pipeline.yaml").write_text(RECORDED)
    assert len(Pipeline.load(tmp_path / "pipeline.yaml", data_root=tmp_path).stages) == 6


def test_a_simulated_plant_needs_what_a_simulation_takes(tmp_path: Path) -> None:
    robot = bare(tmp_path)
    (tmp_path / "pipeline.yaml").write_text(PIPELINE.replace("one_axis_true", "robot.yaml"))
    with pytest.raises(
        FileProblems, match=r"acquire\.with\.plant: the robot file of bare lacks .* controller of"
    ):
        Pipeline.load(tmp_path / "pipeline.yaml")
    assert robot.left_out(DriveAcquisition().needs_of_axes()).count("_limit of") == 2
