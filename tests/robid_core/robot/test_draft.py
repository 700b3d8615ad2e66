"""A project around a URDF: what the file knows is taken, the rest waits at its line, and filled in it runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid_core import ConfigurationError, Robot
from robid_core.robot.draft import draft_of
from robid_core.robot.file.proposal import WIND_UP
from robid_core.robot.stability import refuse_unstable
from robid_core.robot.urdf import robot_to_urdf

LIMIT = '<limit lower="-1.5" upper="2" effort="{effort}" velocity="3"/>'
FILL = {
    "gear_ratio": "100",
    "rotor_inertia": "1.0e-4",
    "torque_constant": "0.1",
    "speed_gain": "0.01",
    "integral_gain": "0.08",
}


def link(name: str, mass: float, size: float, extra: str = "") -> str:
    moment = mass * size**2 / 12
    tensor = f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment / 4}" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><origin xyz="0 0 {size / 2}"/><mass value="{mass}"/>{tensor}</inertial>'
    return f'<link name="{name}">{inertial}{extra}</link>'


def joint(name: str, parent: str, child: str, axis: str, xyz: str, effort: float, more: str = "") -> str:
    kind = "prismatic" if "finger" in name else "revolute"
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/>{LIMIT.format(effort=effort)}{more}</joint>'
    )


MESH = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'
PARTS = (
    '<link name="base"/>',
    joint("turn", "base", "column", "0 0 1", "0 0 0.2", 200),
    link("column", 6, 0.2, MESH),
    joint("swing", "column", "arm", "0 1 0", "0 0 0", 180),
    link("arm", 5, 0.5, MESH),
    joint("wrist", "arm", "hand", "1 0 0", "0 0 0.5", 40),
    link("hand", 1.2, 0.1),
    joint("finger_left", "hand", "left", "0 1 0", "0 0.02 0.1", 5),
    link("left", 0.05, 0.05),
    joint("finger_right", "hand", "right", "0 1 0", "0 -0.02 0.1", 5, '<mimic joint="finger_left"/>'),
    link("right", 0.05, 0.05),
)


def urdf(folder: Path, *parts: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return path


def filled(text: str) -> str:
    for key, value in FILL.items():
        text = text.replace(f"{key}: fill_in", f"{key}: {value}")
    return text


def test_every_value_that_waits_is_refused_at_its_line_all_at_once(tmp_path: Path) -> None:
    draft = draft_of(urdf(tmp_path, *PARTS), "arm")
    (tmp_path / "robot.yaml").write_text(draft.robot)
    with pytest.raises(ConfigurationError) as refused:
        Robot.load("robot.yaml", tmp_path)
    told = str(refused.value).splitlines()
    waiting = [n for n, line in enumerate(draft.robot.splitlines(), 1) if ": fill_in" in line]
    assert len(told) == len(waiting) == draft.to_fill_in == 3 * len(FILL)
    for line, number in zip(told, waiting, strict=True):
        assert line.startswith(f"robot.yaml:{number}:")
        assert "still to fill in: a number; " in line


def test_filled_in_it_is_a_robot_with_the_limits_of_the_urdf_and_grippers_locked(tmp_path: Path) -> None:
    draft = draft_of(urdf(tmp_path, *PARTS), "arm")
    (tmp_path / "robot.yaml").write_text(filled(draft.robot))
    (tmp_path / "plant.yaml").write_text(draft.plant)
    robot, plant = (Robot.load(name, tmp_path) for name in ("robot.yaml", "plant.yaml"))
    assert robot.axis_names == ("turn", "swing", "wrist")
    assert robot.chain.mass.sum() == pytest.approx(6 + 5 + 1.2 + 2 * 0.05)  # fingers are part of the hand
    np.testing.assert_allclose(robot.drives.torque_limit, [2.0, 1.8, 0.4])
    np.testing.assert_allclose(robot.drives.speed_limit, 300)
    assert robot.drives.lower.tolist() == [-1.5] * 3
    found = {name: robot.parameter(name) for name in robot.stiffness_names}
    assert found["gear_stiffness.turn"] == pytest.approx(200 / WIND_UP, rel=1e-3)
    assert found["gear_stiffness.swing"] == pytest.approx(180 / WIND_UP, rel=1e-3)
    for name, value in found.items():
        assert plant.parameter(name) == pytest.approx(0.75 * value)
    remarks = "\n".join(draft.remarks)
    assert "2 meshes cannot be drawn: link 'column': 'a.stl' is not found" in remarks
    assert "joint 'finger_right' is locked at 0: mimics finger_left" in remarks
    assert "joint 'finger_left' is locked at 0: others mimic it" in remarks
    assert "no bearing 'turn_y': the line of swing, whose gear would be the same spring" in remarks
    assert not [name for name in found if name.startswith("bearing_stiffness.turn_y")]
    assert "bearing_stiffness.turn_x" in found


def test_proposed_controllers_keep_a_simulated_robot_calm_and_its_sensors_make_noise(tmp_path: Path) -> None:
    """With the proposed gains the loops are stable; noise is 0.6 thousandths of the torque limit at ratio 100."""
    text = draft_of(urdf(tmp_path, *PARTS), "arm").robot
    rule = re.compile(
        r"speed_gain: fill_in +# N m s/rad; 20 \* \(rotor_inertia \+ ([\d.e-]+) / gear_ratio\^2\)"
    )
    gains = [20 * (1e-4 + float(carried) / 100**2) for carried in rule.findall(text)]
    assert len(gains) == text.count("N m/rad; 8 * speed_gain") == 3
    for gain in gains:
        text = text.replace("speed_gain: fill_in", f"speed_gain: {gain}", 1)
        text = text.replace("integral_gain: fill_in", f"integral_gain: {8 * gain}", 1)
    (tmp_path / "robot.yaml").write_text(filled(text))
    robot = Robot.load("robot.yaml", tmp_path)
    for angle in np.random.default_rng(0).uniform(-1.5, 1.5, (4, 3)):
        refuse_unstable(robot, angle, 0.25 * robot.sample_time_s, "midpoint")
    np.testing.assert_allclose(robot.drives.torque_noise, 6e-4 * robot.drives.torque_limit, rtol=0.02)


def test_a_bearing_that_no_motor_stirs_is_not_proposed(tmp_path: Path) -> None:
    """A symmetric pendulum swings in its plane: no product of inertia joins its axis to those across."""
    parts = (
        '<link name="base"/>',
        joint("swing", "base", "arm", "0 1 0", "0 0 0", 180),
        link("arm", 80, 0.5),
    )
    draft = draft_of(urdf(tmp_path, *parts), "arm")
    assert "bearings" not in draft.robot
    for letter in "xz":
        assert (
            f"no bearing 'swing_{letter}': no joint's motion excites it (coupling 0 at most)" in draft.remarks
        )


def test_of_springs_about_one_point_no_more_are_proposed_than_motors_determine(tmp_path: Path) -> None:
    """A shoulder whose axes meet: a gear and a tilt before, two tilts behind; apart all four are proposed."""
    for distance, left in ((0, ["upper_x"]), (0.15, [])):
        parts = (
            '<link name="base"/>',
            joint("turn", "base", "column", "0 0 1", "0 0 0", 400),
            link("column", 20, 0.3),
            joint("upper", "column", "arm", "0 1 0", f"{distance} 0 0", 400),
            link("arm", 20, 0.6),
            joint("elbow", "arm", "forearm", "0 1 0", "0 0 0.6", 100),
            link("forearm", 10, 0.5),
        )
        draft = draft_of(urdf(tmp_path, *parts), "arm")
        told = [remark.split("'")[1] for remark in draft.remarks if "in one point" in remark]
        assert told == left
        bearings = [name for name in ("turn_x", "upper_x", "upper_z") if f"  {name}: " in draft.robot]
        assert bearings == [name for name in ("turn_x", "upper_x", "upper_z") if name not in left]


def test_a_spring_too_stiff_to_be_seen_is_left_out_aloud(tmp_path: Path) -> None:
    """8 mrad at 4000 N m, 5e5 N m/rad, on a hand of 1.3 kg and at most 0.03 kg m^2: above 600 Hz."""
    parts = tuple(part.replace('effort="40"', 'effort="4000"') for part in PARTS)
    draft = draft_of(urdf(tmp_path, *parts), "arm")
    (told,) = [remark for remark in draft.remarks if "rigid" in remark]
    frequency = float(re.findall(r"gear of 'wrist': taken as rigid, it would swing at (\d+) Hz", told)[0])
    assert frequency > 600
    wrist = draft.robot[draft.robot.index("  wrist:") :]
    assert "gear: {" not in wrist
    assert draft.robot.count("gear: {") == 2


@pytest.mark.parametrize(
    ("other", "told"), [("finger_left_", "'finger_left_', which is no joint"), ("finger_right", "itself")]
)
def test_a_joint_that_mimics_none_is_refused(tmp_path: Path, other: str, told: str) -> None:
    """The finger that it should mimic would become an axis with a motor."""
    parts = tuple(part.replace('<mimic joint="finger_left"/>', f'<mimic joint="{other}"/>') for part in PARTS)
    with pytest.raises(ConfigurationError, match=f"joint 'finger_right' mimics {told}"):
        draft_of(urdf(tmp_path, *parts), "arm")


def test_an_axis_along_the_arm_carries_what_turns_about_it(tmp_path: Path) -> None:
    """A forearm in line with its joint has no lever, however long the arm is; about the one before it is a pendulum."""
    parts = (
        '<link name="base"/>',
        joint("lift", "base", "arm", "0 1 0", "0 0 0", 0),
        link("arm", 6, 0.6),
        joint("roll", "arm", "forearm", "0 0 1", "0 0 0.6", 0),
        link("forearm", 4, 0.5),
    )
    text = draft_of(urdf(tmp_path, *parts), "arm").robot
    carried = [float(one) for one in re.findall(r"rotor_inertia \+ ([\d.e-]+) / gear_ratio", text)]
    roll = 4 * 0.5**2 / 48
    lift = 6 * 0.6**2 * (1 / 12 + 1 / 4) + 4 * (0.5**2 / 12 + 0.85**2)
    assert carried == pytest.approx([lift, roll], rel=1e-2)


def test_a_urdf_that_robid_wrote_keeps_its_springs_and_gets_no_others(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(robot_to_urdf(Robot.load("six_axis")))
    draft = draft_of(tmp_path / "arm.urdf", "again")
    assert "no further springs are proposed" in draft.remarks
    (tmp_path / "robot.yaml").write_text(
        filled(draft.robot).replace("torque_noise: fill_in", "torque_noise: 1")
    )
    (tmp_path / "plant.yaml").write_text(draft.plant)
    robot, plant = (Robot.load(name, tmp_path) for name in ("robot.yaml", "plant.yaml"))
    written = Robot.load("six_axis")
    assert robot.parameter("bearing_stiffness.axis_2_gear") == written.parameter("gear_stiffness.axis_2")
    assert len(robot.stiffness_names) == len(written.stiffness_names)
    for name in robot.stiffness_names:
        assert plant.parameter(name) == pytest.approx(0.75 * robot.parameter(name))


def test_a_urdf_that_robid_wrote_keeps_its_motors(tmp_path: Path) -> None:
    """Rotors of all axes; ratios and friction of those that no other motor turns."""
    written = Robot.load("six_axis").with_parameters({"friction.axis_1.coulomb": 0.7})
    (tmp_path / "arm.urdf").write_text(robot_to_urdf(written))
    draft = draft_of(tmp_path / "arm.urdf", "again").robot
    told = YAML(typ="safe").load(draft)["axes"]
    own = np.linalg.inv(written.drives.gear)
    for number, axis in enumerate(written.axis_names):
        assert told[axis]["rotor_inertia"] == pytest.approx(
            float(written.drives.rotor_inertia[number]), rel=1e-8
        )
        if np.count_nonzero(written.drives.gear[number]) > 1:
            assert told[axis]["gear_ratio"] == "fill_in"
            continue
        assert told[axis]["gear_ratio"] == pytest.approx(float(own[number, number]), rel=1e-8)
        friction = told[axis]["friction"]
        assert friction["coulomb"] == pytest.approx(float(written.drives.coulomb[number]), rel=1e-5)
        assert friction["viscous"] == pytest.approx(float(written.drives.viscous[number]), rel=1e-5)


def test_friction_of_a_foreign_urdf_is_told_at_the_joint(tmp_path: Path) -> None:
    """Without a gear ratio it cannot be taken to the motor."""
    dynamics = '<dynamics damping="12.5" friction="8"/>'
    path = urdf(
        tmp_path,
        '<link name="base"/>',
        joint("turn", "base", "arm", "0 0 1", "0 0 0.2", 200, dynamics),
        link("arm", 6, 0.4),
    )
    (line,) = [line for line in draft_of(path, "arm").robot.splitlines() if "friction:" in line]
    assert "{coulomb: 0, viscous: 0}" in line
    assert "the URDF has 8 N m and 12.5 N m s/rad at the joint" in line


def test_what_the_urdf_leaves_out_waits_too(tmp_path: Path) -> None:
    parts = tuple(
        part.replace('effort="40"', 'effort="0"').replace("revolute", "continuous", 1) for part in PARTS
    )
    text = draft_of(urdf(tmp_path, *parts), "arm").robot
    assert re.search(r"position_limits: \[-3.14, 3.14\] +# .*none in the URDF: one turn proposed", text)
    assert re.search(r"torque_limit: fill_in +# at the motor, N m; none in the URDF", text)
    assert "proposed: the URDF gives no torque; 15 Hz with all that it carries" in text
    assert re.search(r"torque_noise: fill_in} +# .*torque_noise: rms of a sample", text)


def test_joints_are_locked_on_request_and_trees_are_told(tmp_path: Path) -> None:
    tree = tuple(part.replace('<mimic joint="finger_left"/>', "") for part in PARTS)
    path = urdf(tmp_path, *tree)
    assert any(
        "'wrist' carries 2 joints (finger_left, finger_right): a tree" in r
        for r in draft_of(path, "a").remarks
    )
    text = draft_of(path, "arm", ("finger_left", "finger_right")).robot
    assert re.search(r"lock: .*\n  finger_left: 0 +# asked for\n  finger_right: 0 +# asked for\n", text)
    with pytest.raises(
        ConfigurationError, match="has no joint 'finger_lef' to lock; did you mean 'finger_left'"
    ):
        draft_of(path, "arm", ("finger_lef",))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("<robot ", "<model "), "describes a <model>, not a <robot>"),
        (('type="revolute"', 'type="planar"'), "is of type 'planar'"),
        (('<mass value="5"/>', '<mass value="0"/>'), "link 'arm' has no inertial with a mass"),
        (('<mass value="5"/>', '<mass value="x"/>'), "mass 'x' is not a number"),
        (("<link name=\"base\"/>", '<link name="base"/><link name="lost"/>'), "hang on no joint"),
        (('parent link="arm"', 'parent link="hand"'), "closed loop"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_chain_is_told_with_its_line(
    tmp_path: Path, change: tuple[str, str], told: str
) -> None:
    path = urdf(tmp_path, *PARTS)
    text = path.read_text().replace(*change)
    path.write_text(text.replace("</robot>", "</model>") if "<model" in text else text)
    with pytest.raises(ConfigurationError, match=told):
        draft_of(path, "arm")


def test_points_without_inertia_and_files_of_another_kind_are_refused(tmp_path: Path) -> None:
    parts = [re.sub(r'i(xx|yy|zz)="[^"]*"', r'i\1="0"', part) for part in PARTS]
    with pytest.raises(
        ConfigurationError, match="joint 'turn' has a mass and no inertia; give its link an <inertia>"
    ):
        draft_of(urdf(tmp_path, *parts), "arm")
    with pytest.raises(ConfigurationError, match=r"not a URDF file \(\*.urdf\): expand it first"):
        draft_of(tmp_path / "arm.xacro", "arm")
    with pytest.raises(ConfigurationError, match="is no file"):
        draft_of(tmp_path / "none.urdf", "arm")
