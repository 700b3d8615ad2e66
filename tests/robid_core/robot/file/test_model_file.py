"""What a model file gives a robot file: limits through the gear, locked and elastic joints, mistakes."""

from __future__ import annotations

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, PluginError, Robot, registry as plugins
from robid_core.mechanics import dynamics
from robid_core.robot.file.model_file import read_model

INERTIAL = """<inertial><origin xyz="0.1 -0.02 0.05"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="0" iyz="0"/></inertial>"""
MIMIC = '<mimic joint="left" multiplier="-1"/>'


def joint(name: str, kind: str, parent: str, more: str = "", limit: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
        f'<origin xyz="0.3 0 0.1" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>{limit}{more}</joint>'
        f'<link name="{name}_link">{INERTIAL}</link>'
    )


LIMIT = '<limit lower="-1.5" upper="2" effort="120" velocity="3"/>'
ARM = (
    '<link name="base"/>',
    joint("shoulder", "revolute", "base", limit=LIMIT),
    joint("elbow", "continuous", "shoulder_link", limit='<limit effort="50" velocity="0"/>'),
    joint("lift", "prismatic", "elbow_link", limit='<limit lower="0" upper="0.2" effort="0" velocity="1"/>'),
    joint("flange", "fixed", "lift_link"),
)
FINGERS = (
    joint("left", "prismatic", "flange_link", limit='<limit upper="0.04" effort="5" velocity="1"/>'),
    joint("right", "prismatic", "flange_link", MIMIC, limit='<limit effort="5" velocity="1"/>'),
)
AXES = """axes:
  shoulder: {gear_ratio: -100, rotor_inertia: 1.0e-4}
  elbow: {gear_ratio: 50, rotor_inertia: 1.0e-4}
  lift: {gear_ratio: 400, rotor_inertia: 1.0e-5}
"""


def written(folder: Path, parts: tuple[str, ...], text: str) -> Path:
    (folder / "arm.urdf").write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    (folder / "robot.yaml").write_text(f"robid_robot: 1\nname: arm\nmodel: arm.urdf\n{text}")
    return folder / "robot.yaml"


@pytest.mark.parametrize(
    ("target", "told"),
    [
        ("builtins:object", "'urdf' (unknown 0) cannot be called with (file, locked joints)"),
        ("operator:is_", "'urdf' (unknown 0) gave a bool for arm.urdf, not a robid_core.RobotModel"),
    ],
)
def test_what_is_registered_as_a_reader_and_is_none_is_told_by_its_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, target: str, told: str
) -> None:
    written(tmp_path, ARM, AXES)
    plain = EntryPoint("urdf", target, plugins.MODELS)
    monkeypatch.setattr("robid_core.robot.file.model_file.registry", lambda: plugins.Registry([plain]))
    with pytest.raises(PluginError, match=re.escape(told)):
        read_model(tmp_path / "arm.urdf", {})


def test_limits_come_through_the_gear_and_the_robot_file_wins(tmp_path: Path) -> None:
    axes = Robot.load(str(written(tmp_path, ARM, AXES))).description.axes
    assert axes["shoulder"].position_limits == (-1.5, 2.0)
    assert (axes["shoulder"].torque_limit, axes["shoulder"].speed_limit) == (1.2, 300.0)
    assert axes["elbow"].position_limits is None  # continuous
    assert (axes["elbow"].torque_limit, axes["elbow"].speed_limit) == (1.0, None)  # 0 is no limit
    assert axes["lift"].position_limits == (0.0, 0.2)
    assert (axes["lift"].torque_limit, axes["lift"].speed_limit) == (None, 400.0)
    own = AXES.replace("1.0e-4}", "1.0e-4, torque_limit: 2, position_limits: null}", 1)
    shoulder = Robot.load(str(written(tmp_path, ARM, own))).description.axes["shoulder"]
    assert (shoulder.torque_limit, shoulder.speed_limit, shoulder.position_limits) == (2.0, 300.0, None)


def test_torques_of_coupled_gears_stay_out(tmp_path: Path) -> None:
    coupling = "coupling: [[0.01, 0, 0], [0.001, 0.02, 0], [0, 0, 0.0025]]\n"
    axis = Robot.load(str(written(tmp_path, ARM, AXES + coupling))).description.axes["shoulder"]
    assert axis.position_limits == (-1.5, 2.0)
    assert (axis.torque_limit, axis.speed_limit) == (None, None)


def test_locked_joints_are_part_of_the_body_before_at_their_coordinate(tmp_path: Path) -> None:
    """The mass matrix is that of the whole arm at these coordinates, rows of the joints that move; bias too."""
    fingers = tuple(part.replace(MIMIC, "") for part in FINGERS)
    lock = "lock: {elbow: 0.7, left: 0.03, right: -0.03}\n"
    axes = "".join(line for line in AXES.splitlines(True) if "elbow" not in line)
    held = Robot.load(str(written(tmp_path, (*ARM, *fingers), lock + axes))).chain
    whole = read_model(tmp_path / "arm.urdf", {}).chain
    place = np.zeros(whole.n_coordinate)
    for name, value in {"elbow": 0.7, "left": 0.03, "right": -0.03}.items():
        place[whole.index(name)] = value
    generator = np.random.default_rng(1)
    for _ in range(3):
        moved, rows = generator.normal(size=2), [whole.index(name) for name in held.names]
        place[rows] = moved
        speed, rate = np.zeros(whole.n_coordinate), generator.normal(size=2)
        speed[rows] = rate
        ours, theirs = dynamics(held, moved, rate), dynamics(whole, place, speed)
        np.testing.assert_allclose(ours.mass, theirs.mass[np.ix_(rows, rows)], rtol=0, atol=1e-12)
        np.testing.assert_allclose(ours.bias, theirs.bias[rows], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("parts", "text", "told"),
    [
        ((*ARM, *FINGERS), AXES, r"robot.yaml:3:1: model: .*'right' mimics another; .* lock it \(lock: {right: 0}"),
        (ARM, f"lock: {{finger: 0}}\n{AXES}", r"robot.yaml:4:8: lock.finger: the model file has no joint 'finger'"),
        (ARM, f"lock: {{lift: x}}\n{AXES}", r"robot.yaml:4:8: lock.lift: 'x' is written here, it must be a number"),
        (ARM, f"lock: [lift]\n{AXES}", r"robot.yaml:4:1: lock: lock names joints"),
        (ARM, f"lock: {{lift: 0}}\n{AXES}", r"robot.yaml:8:3: axes.lift: joint 'lift' is locked"),
        (ARM[:1], "lock: {}\naxes: {}\n", "no joint moves"),
        ((*ARM, '<xacro:include filename="a.xacro"/>'), AXES, "xacro"),
        ((*ARM, joint("last", "revolute", "lift_link")), AXES, "joint 'last' has no <limit>; URDF asks for"),
        ((*ARM, joint("base_free", "floating", "flange_link")), AXES, "type 'floating'.*make it fixed"),
    ],
)  # fmt: skip
def test_what_does_not_belong_together_is_told_in_place(
    tmp_path: Path, parts: tuple[str, ...], text: str, told: str
) -> None:
    path = written(tmp_path, parts, text)
    if "xacro" in told:
        source = (tmp_path / "arm.urdf").read_text().replace("<robot", '<robot xmlns:xacro="x"', 1)
        (tmp_path / "arm.urdf").write_text(source)
    with pytest.raises(ConfigurationError, match=told):
        Robot.load(str(path))


def test_an_exported_urdf_is_the_robot_again_elastic_joints_as_joints(tmp_path: Path) -> None:
    """Elastic gears come back as elastic joints behind rigid gears: the same arm in other coordinates, u = U z."""
    robot = Robot.load("universal_arm")
    axes = "".join(
        f"  {name}: {{gear_ratio: {axis.gear_ratio}, rotor_inertia: {axis.rotor_inertia}}}\n"
        for name, axis in robot.description.axes.items()
    )
    (tmp_path / "arm.urdf").write_text(robot.to_urdf())
    (tmp_path / "robot.yaml").write_text(f"robid_robot: 1\nname: arm\nmodel: arm.urdf\naxes:\n{axes}")
    again = Robot.load("robot.yaml", tmp_path)
    for name, axis in again.description.axes.items():
        own = robot.description.axes[name]
        assert axis.position_limits == own.position_limits
        assert axis.torque_limit == pytest.approx(own.torque_limit, rel=1e-14)
        assert axis.speed_limit == pytest.approx(own.speed_limit, rel=1e-14)
    ours, theirs = robot.mechanism.coordinate_names, again.mechanism.coordinate_names
    turned = np.zeros((len(theirs), len(ours)))
    for row, name in enumerate(theirs):
        joint_name = name.removesuffix("_gear")
        turned[row, ours.index(joint_name)] = 1.0
        if name.endswith("_gear"):
            turned[row, : robot.n_axis] = -robot.drives.gear[robot.axis_names.index(joint_name)]
    angle = np.array([[0.3, -0.7, 0.9, 0.2, -0.4, 0.6]])
    rest, found = robot.equilibrium(angle), again.equilibrium(angle)
    np.testing.assert_allclose(found.torque, rest.torque, rtol=0, atol=1e-12)
    position = turned @ rest.position[0]
    stiffness, damping = robot.spring_arrays()
    model = robot.batches.second_order_model(robot.mechanism, stiffness, damping, rest.position)
    k, d = again.spring_arrays()
    other = again.batches.second_order_model(again.mechanism, k, d, position[None])
    for name in ("mass", "damping", "stiffness"):
        mine = getattr(model, name)[0]
        back = turned.T @ getattr(other, name)[0] @ turned
        np.testing.assert_allclose(back, mine, rtol=0, atol=1e-12 * abs(mine).max())
