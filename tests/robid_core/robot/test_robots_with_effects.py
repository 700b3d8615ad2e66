"""Robots with effects of the catalogue: out to YAML and back, parameters by name, data sheets at work."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot, registry as plugins

SHEET = """\
robid_robot: 1
name: sheet
bodies:
  - {joint: a, axis: [0, 1, 0], mass: 20, centre_of_mass: [0, 0, 0.5], inertia: [[1, 0, 0], [0, 1, 0], [0, 0, 0.5]]}
axes:
  a:
    gear_ratio: 121
    rotor_inertia: 2.0e-3
    torque_limit: 30
    speed_limit: 400
    controller: {speed_gain: 0.2}
    gear: {data_sheet: {K_nm_per_arcmin: 30, lost_motion_arcmin: 1, rated_torque: 150}}
    bearing: {moment_rigidity_nm_per_arcmin: 390}
"""


@pytest.fixture(autouse=True)
def catalogue(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint(
            "transmission.piecewise_linear", "robid_effects.piecewise_linear:PiecewiseLinear", plugins.EFFECTS
        ),
        *entry_points(group=plugins.MODELS),
    ]
    registry = plugins.Registry(points)
    monkeypatch.setattr(plugins, "registry", lambda: registry)


def test_a_robot_of_data_sheets_goes_out_to_yaml_and_loads_equal(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(SHEET)
    robot = Robot.load("robot.yaml", tmp_path)
    (tmp_path / "written.yaml").write_text(robot.to_yaml())
    back = Robot.load("written.yaml", tmp_path)
    assert back == robot
    assert back.to_yaml() == robot.to_yaml()
    assert back.parameters() == robot.parameters()
    assert robot.stiffness_names == ("gear_stiffness.a", "bearing_stiffness.a_x", "bearing_stiffness.a_z")


def test_an_effects_parameter_is_set_by_name_like_any_other(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(SHEET)
    robot = Robot.load("robot.yaml", tmp_path)
    name = "effect.a_curve.lost_motion"
    assert robot.parameter_unit(name) == "rad"
    assert robot.parameter_kind(name) == "effect"
    changed = robot.with_parameters({name: 1e-3})
    assert {n for n, v in changed.parameters().items() if v != robot.parameters()[n]} == {name}
    assert changed.parameters()[name] == 1e-3
    with pytest.raises(ConfigurationError, match=r"lost_motion: 0.2 is outside 0 to 0.1 rad"):
        robot.with_parameters({name: 0.2})


def test_a_truth_adds_an_effect_to_a_packaged_robot(tmp_path: Path) -> None:
    (tmp_path / "truth.yaml").write_text("""\
robid_robot: 1
name: with_play
base: one_axis
effects:
  play: {use: transmission.piecewise_linear, on: axis_1, side: gear, with: {torque_1: 20, torque_2: 90}}
parameters:
  effect.play.lost_motion: 3.0e-4
""")
    truth, nominal = Robot.load("truth.yaml", tmp_path), Robot.load("one_axis")
    own = {n: v for n, v in truth.parameters().items() if not n.startswith("effect.")}
    assert own == nominal.parameters()
    assert truth.parameters()["effect.play.lost_motion"] == 3e-4
    assert truth.parameters()["effect.play.stiffness_2"] == 1.1e5  # the table's default
    np.testing.assert_array_equal(truth.chain.mass, nominal.chain.mass)
    (tmp_path / "back.yaml").write_text(truth.to_yaml())
    assert Robot.load("back.yaml", tmp_path) == truth
