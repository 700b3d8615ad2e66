"""A wrong robot file: every mistake at its line and column, with the axis and the number, all at once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError
from robid_core.robot.file.reading import find_robot, read_description
from robid_core.settings_types import Places, robot_source
from robid_core.yaml_file.problems import FileProblems

TEXT = """\
robid_robot: 1
name: two
bodies:
  - {joint: shoulder, axis: [0, 0, 1], mass: 30, inertia: [[2, 0, 0], [0, 2, 0], [0, 0, 1]]}
  - joint: elbow
    parent: shoulder
    axis: [0, 1, 0]
    translation: [0, 0, 0.5]
    mass: 12
    centre_of_mass: [0, 0, 0.2]
    inertia: [[0.4, 0, 0], [0, 0.5, 0], [0, 0, 0.2]]
axes:
  shoulder:
    gear_ratio: 100
    rotor_inertia: 1.0e-3
    torque_limit: 20
    speed_limit: 400
    position_limits: [-2, 2]
    gear: {stiffness: 8.0e+4, damping: 60}
    controller: {speed_gain: 0.1}
  elbow:
    gear_ratio: -80
    rotor_inertia: 5.0e-4
    torque_limit: 10
    speed_limit: 500
    controller: {speed_gain: 0.05}
bearings:
  shoulder_x: {joint: shoulder, axis: [1, 0, 0], stiffness: 3.0e+5, damping: 100}
effects:
  grease: {use: friction.stribeck, on: elbow, side: motor, with: {breakaway: 1.2}}
"""

pytestmark = pytest.mark.usefixtures("effects_of_a_stranger")


def mistakes(folder: Path, *changes: tuple[str, str], text: str = TEXT) -> list[str]:
    """Return what is told of the file after some replacements, one line each, without the file's name."""
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(FileProblems) as refused:
        read_description(folder / "robot.yaml")
    assert isinstance(refused.value, ConfigurationError)
    lines = str(refused.value).split("\n")
    assert all(line.startswith("robot.yaml:") for line in lines), lines
    return [line.removeprefix("robot.yaml:") for line in lines]


def test_the_file_is_right_as_it_stands(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(TEXT, encoding="utf-8")
    assert list(read_description(tmp_path / "robot.yaml").axes) == ["shoulder", "elbow"]


LOOP = "closed loop, which robid does not model: bodies form a chain or a tree"

CASES: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {
    # name: (what is replaced by what), (place and path, then words of the message)
    "negative stiffness": (
        ("stiffness: 8.0e+4", "stiffness: -8.0e+4"),
        ("19:12: axes.shoulder.gear.stiffness: -80000.0 must be greater than 0; stiffness: N m/rad",),
    ),
    "negative damping": (
        ("damping: 60", "damping: -60"),
        ("19:31: axes.shoulder.gear.damping: -60 must be at least 0; damping: N m s/rad, joint side",),
    ),
    "negative bearing stiffness": (
        ("stiffness: 3.0e+5", "stiffness: -3.0e+5"),
        ("28:50: bearings.shoulder_x.stiffness: -300000.0 must be greater than 0",),
    ),
    "no gear ratio": (
        ("gear_ratio: 100", "gear_ratio: 0"),
        ("14:5: axes.shoulder.gear_ratio: gear_ratio must not be 0; give motor turns per joint turn",),
    ),
    "rotor without inertia": (
        ("rotor_inertia: 5.0e-4", "rotor_inertia: 0"),
        ("23:5: axes.elbow.rotor_inertia: 0 must be greater than 0; rotor_inertia: Inertia of rotor",),
    ),
    "limits reversed": (
        ("[-2, 2]", "[2, -2]"),
        (
            "18:5: axes.shoulder.position_limits: the lower limit 2 is not below the upper one -2; write [lower",
        ),
    ),
    "limits of three numbers": (
        ("[-2, 2]", "[-2, 0, 2]"),
        (
            "18:5: axes.shoulder.position_limits: 3 entries, there must be at most 2; position_limits: Joint-side",
        ),
    ),
    "decimal comma in a list": (
        ("centre_of_mass: [0, 0, 0.2]", "centre_of_mass: [0, 0, 0,2]"),
        (
            "10:5: bodies[1].centre_of_mass: joint 'elbow': 4 entries, there must be 3; decimal commas? A comma parts",
        ),
    ),
    "decimal comma in a mapping": (
        ("mass: 30,", "mass: 30,5,"),
        ("4:49: bodies[0].5: joint 'shoulder': unknown key '5'; decimal comma? A comma parts the entries",),
    ),
    "decimal comma": (
        ("    mass: 12", "    mass: 12,5"),
        (
            "9:5: bodies[1].mass: joint 'elbow': '12,5' is written here, it must be a number; decimal comma? Write",
        ),
    ),
    "gravity as one number": (
        ("name: two\n", "name: two\ngravity: -9.81\n"),
        ("3:1: gravity: -9.81 is written here, three numbers are wanted, along x, y and z: [0, 0, -9.81]",),
    ),
    "triangle inequality": (
        ("[0, 0.5, 0]", "[0, 0.7, 0]"),
        (
            "11:5: bodies[1].inertia: joint 'elbow': principal moments 0.2, 0.4, 0.7 kg m^2: no body has the largest",
        ),
    ),
    "negative moment of inertia": (
        ("[[2, 0, 0]", "[[-2, 0, 0]"),
        ("4:50: bodies[0].inertia: joint 'shoulder': a principal moment is -2 kg m^2; none may be negative",),
    ),
    "inertia that is not symmetric": (
        ("[[0.4, 0, 0]", "[[0.4, 0.1, 0]"),
        (
            "11:5: bodies[1].inertia: joint 'elbow': the matrix is not symmetric: row 1 has 0.1 where row 2 has 0",
        ),
    ),
    "negative mass": (
        ("mass: 12", "mass: -12"),
        ("9:5: bodies[1].mass: joint 'elbow': -12 must be at least 0; mass: Mass in kg",),
    ),
    "inertia without mass": (
        ("mass: 12", "mass: 0"),
        (
            "11:5: bodies[1].inertia: joint 'elbow': a body of mass 0 has an inertia of 0.5 kg m^2; give its mass",
        ),
    ),
    "axis of length two": (
        ("axis: [0, 1, 0]", "axis: [0, 2, 0]"),
        (
            "7:5: bodies[1].axis: joint 'elbow': the direction [0.0, 2.0, 0.0] has length 2; give a unit vector, such "
            "as [0.0, 1.0, 0.0]",
        ),
    ),
    "axis of length zero": (
        ("axis: [0, 0, 1]", "axis: [0, 0, 0]"),
        (
            "4:23: bodies[0].axis: joint 'shoulder': the direction [0.0, 0.0, 0.0] has length 0; give a unit vector",
        ),
    ),
    "rotation that mirrors": (
        ("mass: 12", "mass: 12\n    rotation: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]"),
        ("10:5: bodies[1].rotation: joint 'elbow': the matrix mirrors (its determinant is -1)",),
    ),
    "rotation that shears": (
        ("mass: 12", "mass: 12\n    rotation: [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]"),
        ("10:5: bodies[1].rotation: joint 'elbow': the rows are not orthonormal (off by 0.2)",),
    ),
    "axis that drives no joint": (
        ("  elbow:\n", "  elbov:\n"),
        (
            "5:5: bodies[1].joint: joint 'elbow' has no drive; give it an entry under axes",
            "21:3: axes.elbov.joint: there is no joint 'elbov' to move; there are shoulder, elbow",
        ),
    ),
    "two axes on one joint": (
        ("gear_ratio: -80", "joint: shoulder\n    gear_ratio: -80"),
        (
            "5:5: bodies[1].joint: joint 'elbow' has no drive",
            "22:5: axes.elbow.joint: joint 'shoulder' is moved by axis 'shoulder' already; every joint has exactly one",
        ),
    ),
    "bearing of no joint": (
        ("{joint: shoulder, axis: [1, 0, 0]", "{joint: sholder, axis: [1, 0, 0]"),
        ("28:16: bearings.shoulder_x.joint: there is no joint 'sholder' to bend; there are shoulder, elbow",),
    ),
    "bearing along its joint": (
        ("axis: [1, 0, 0]", "axis: [0, 0, -1]"),
        (
            "28:33: bearings.shoulder_x.axis: about [0.0, 0.0, -1.0] joint 'shoulder' can turn already (joint and "
            "bearings so far: [[0.0, 0.0, 1.0]]); up to two bearings across a revolute joint",
        ),
    ),
    "third bearing across a joint": (
        (
            "effects:\n",
            "  second: {joint: shoulder, axis: [0, 1, 0], stiffness: 1, damping: 0}\n"
            "  third: {joint: shoulder, axis: [0.6, 0.8, 0], stiffness: 1, damping: 0}\neffects:\n",
        ),
        ("30:28: bearings.third.axis: about [0.6, 0.8, 0.0] joint 'shoulder' can turn already",),
    ),
    "bearing called like a joint": (
        ("shoulder_x: ", "elbow: "),
        (
            "28:3: bearings.elbow: a joint is called 'elbow' already; an elastic coordinate needs its own name",
        ),
    ),
    "effect on an unknown axis": (
        ("on: elbow", "on: wrist"),
        (
            "30:36: effects.grease.on: there is no axis, bearing or body 'wrist'; there are shoulder, elbow, "
            "shoulder_x, base",
        ),
    ),
    "effect that nobody registered": (
        ("friction.stribeck", "friction.stribek"),
        ("30:12: effects.grease.use: no effect 'friction.stribek'; did you mean 'friction.stribeck'?",),
    ),
    "effect without a table": (
        ("friction.stribeck", "friction.none"),
        (
            "30:12: effects.grease.use: effect 'friction.none' (unknown 0) lacks parameters; see "
            "`robid init --plugin effect`",
        ),
    ),
    "effect's parameter misspelt": (
        ("breakaway: 1.2", "break_away: 1.2"),
        (
            "30:67: effects.grease.with.break_away: effect 'friction.stribeck' has no parameter 'break_away'; did you "
            "mean 'breakaway'?",
        ),
    ),
    "effect's parameter out of bounds": (
        ("breakaway: 1.2", "breakaway: 51"),
        ("30:67: effects.grease.with.breakaway: 51 is outside 0 to 50 N m",),
    ),
    "effect's parameter as text": (
        ("breakaway: 1.2", "breakaway: much"),
        ("30:67: effects.grease.with.breakaway: 'much' is written here, it must be a number",),
    ),
    "label that is no name": (
        ("  grease:", "  grease of elbow:"),
        (
            "30:3: effects.grease of elbow: 'grease of elbow' is no name; take letters, digits and underscores",
        ),
    ),
    "parent that does not exist": (
        ("parent: shoulder", "parent: sholder"),
        (
            "6:5: bodies[1].parent: joint 'elbow': there is no joint 'sholder'; joints before this one: shoulder",
        ),
    ),
    "two parents": (
        ("parent: shoulder", "parent: [shoulder, base]"),
        (f"6:5: bodies[1].parent: joint 'elbow': 2 parents (shoulder, base) make a {LOOP}",),
    ),
    "a joint twice, with two parents": (
        ("axes:\n", "  - {joint: elbow, mass: 1}\naxes:\n"),
        (
            f"12:6: bodies[2].joint: joint 'elbow' stands twice, with parents 'shoulder' and the base: a {LOOP}",
        ),
    ),
    "a joint twice": (
        ("axes:\n", "  - {joint: elbow, parent: shoulder, mass: 1}\naxes:\n"),
        ("12:6: bodies[2].joint: joint 'elbow' stands twice; give every joint its own name",),
    ),
    "parents in a ring": (
        ("{joint: shoulder, axis: [0, 0, 1]", "{joint: shoulder, parent: elbow, axis: [0, 0, 1]"),
        (f"4:23: bodies[0].parent: joint 'shoulder': shoulder -> elbow -> shoulder is a {LOOP}",),
    ),
    "coupling that is not square": (
        ("bearings:\n", "coupling: [[0.01, 0], [0, 0.0125], [0, 0]]\nbearings:\n"),
        ("27:1: coupling: coupling is 3 x 2, not 2 x 2 for axes shoulder, elbow; give a row for each joint",),
    ),
    "coupling with a short row": (
        ("bearings:\n", "coupling: [[0.01, 0], [0.0125]]\nbearings:\n"),
        ("27:1: coupling: coupling is 2 rows of 1 to 2, not 2 x 2 for axes shoulder, elbow",),
    ),
    "singular coupling": (
        ("bearings:\n", "coupling: [[0.01, 0.02], [0.005, 0.01]]\nbearings:\n"),
        (
            "27:1: coupling: coupling is singular (singular values 0.025 to ",
            "): motors shoulder, elbow can turn together without moving a joint",
        ),
    ),
    "step that does not divide the sample": (
        ("name: two\n", "name: two\nstep_s: 0.0003\n"),
        (
            "3:1: step_s: sample_time_s 0.001 s is not a whole number of steps of 0.0003 s; give a step of 0.000333333",
        ),
    ),
    "kilohertz for seconds": (
        ("name: two\n", "name: two\nsample_time_s: 4\n"),
        (
            "3:1: sample_time_s: 4 s is no sample time of a drive, which lies between 1e-07 and 2.5 s; give seconds a",
        ),
    ),
    "infinite torque": (
        ("torque_limit: 10", "torque_limit: .inf"),
        (
            "24:5: axes.elbow.torque_limit: inf is written here, it must be a finite number; torque_limit: Largest",
        ),
    ),
    "number as text": (
        ("speed_limit: 500", "speed_limit: fast"),
        (
            "25:5: axes.elbow.speed_limit: 'fast' is written here, it must be a number; speed_limit: Largest speed",
        ),
    ),
    "nothing written": (
        ("rotor_inertia: 5.0e-4", "rotor_inertia:"),
        ("23:5: axes.elbow.rotor_inertia: nothing is written here, it must be a number",),
    ),
    "yes as a number": (
        ("rotor_inertia: 5.0e-4", "rotor_inertia: true"),
        ("23:5: axes.elbow.rotor_inertia: True is written here, it must be a number",),
    ),
    "feedforward above one": (
        ("{speed_gain: 0.05}", "{speed_gain: 0.05, speed_feedforward: 1.5}"),
        (
            "26:36: axes.elbow.controller.speed_feedforward: 1.5 must be at most 1; speed_feedforward: Share of the",
        ),
    ),
    "key misspelt": (
        ("mass: 12", "mas: 12"),
        ("9:5: bodies[1].mas: joint 'elbow': unknown key 'mas'; did you mean 'mass'?",),
    ),
    "required key misspelt is one mistake": (
        ("rotor_inertia: 5.0e-4", "rotor_inerta: 5.0e-4"),
        ("23:5: axes.elbow.rotor_inerta: unknown key 'rotor_inerta'; did you mean 'rotor_inertia'?",),
    ),
    "key missing": (
        ("    rotor_inertia: 5.0e-4\n", ""),
        ("21:3: axes.elbow.rotor_inertia: the key 'rotor_inertia' is missing: Inertia of rotor",),
    ),
    "joint of another kind": (
        ("parent: shoulder", "type: ball\n    parent: shoulder"),
        (
            "6:5: bodies[1].type: joint 'elbow': 'ball' must be 'revolute' or 'prismatic'; type: How the joint moves",
        ),
    ),
    "vector too short": (
        ("translation: [0, 0, 0.5]", "translation: [0, 0.5]"),
        (
            "8:5: bodies[1].translation[2]: joint 'elbow': the list is too short: item 2 (counted from 0) is missing",
        ),
    ),
    "another version": (
        ("robid_robot: 1", "robid_robot: 2"),
        ("1:1: robid_robot: 2 must be 1; robid_robot: Version of this file format",),
    ),
    "flexible link with one end": (
        ("mass: 12", "mass: 12\n    flexible: {file: link.npz, root: 3, tip: 3}"),
        (
            "10:5: bodies[1].flexible: joint 'elbow': root and tip are both node 3; give the nodes at the link's",
        ),
    ),
    "static condensation with modes": (
        ("mass: 12", "mass: 12\n    flexible: {file: link.npz, root: 0, tip: 3, method: guyan, modes: 4}"),
        ("10:5: bodies[1].flexible: joint 'elbow': guyan keeps no modes, 4 are asked for",),
    ),
    "flexible link damped beyond critical": (
        ("mass: 12", "mass: 12\n    flexible: {file: link.npz, root: 0, tip: 3, damping_ratio: 1.2}"),
        ("10:49: bodies[1].flexible.damping_ratio: joint 'elbow': 1.2 must be less than 1",),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_mistake_is_told_where_it_stands(name: str, tmp_path: Path) -> None:
    change, expected = CASES[name]
    found = mistakes(tmp_path, change)
    starts = [words for words in expected if words[0].isdigit()]
    assert len(found) == len(starts), found
    for line, start in zip(found, starts, strict=True):
        assert line.startswith(start), found
    assert all(any(words in line for line in found) for words in expected), found


def test_all_mistakes_of_a_file_are_told_at_once_and_in_the_order_of_lines(tmp_path: Path) -> None:
    changes = [CASES[name][0] for name in CASES if name in (
        "negative stiffness", "no gear ratio", "limits reversed", "triangle inequality", "number as text",
        "effect's parameter out of bounds", "bearing of no joint", "axis of length zero", "effect on an unknown axis",
        "another version", "step that does not divide the sample",
    )]  # fmt: skip
    found = mistakes(tmp_path, *changes)
    places = [tuple(int(number) for number in line.split(":")[:2]) for line in found]
    assert len(found) == len(changes), found
    assert places == sorted(places)


def test_a_robot_without_axes_and_one_without_bodies_are_refused(tmp_path: Path) -> None:
    head = "robid_robot: 1\nname: none\n"
    found = mistakes(tmp_path, text=head + "bodies: []\naxes: {}\n")
    assert [line.partition(";")[0] for line in found] == [
        "3:1: bodies: 0 entries, there must be at least 1",
        "4:1: axes: 0 entries, there must be at least 1",
    ]
    found = mistakes(tmp_path, text=head)
    assert found == [
        "1:1: axes: the key 'axes' is missing: Drives in the order of motors",
        "1:1: bodies: the key 'bodies' is missing: The chain or tree, parents before children",
    ]


def test_a_model_file_is_told_at_the_line_that_names_it(tmp_path: Path) -> None:
    tail = "axes:\n  a: {rotor_inertia: 1, torque_limit: 1, speed_limit: 1, controller: {speed_gain: 1}}\n"
    head = "robid_robot: 1\nname: none\n"
    (found,) = mistakes(tmp_path, text=f"{head}model: none.urdf\n{tail}")
    assert found.startswith("3:1: model: ")
    assert "none.urdf is no file" in found
    (tmp_path / "robot.sdf").write_text("<sdf/>")
    (found,) = mistakes(tmp_path, text=f"{head}model: robot.sdf\n{tail}")
    assert (
        found
        == "3:1: model: no reader of robot models 'sdf'; there are: urdf; is the package that brings it installed here?"
    )
    pytest.importorskip("pinocchio")
    joint = '<joint name="a" type="continuous"><parent link="{}"/><child link="{}"/></joint>'
    (tmp_path / "robot.urdf").write_text(
        f'<robot name="r">\n<link name="b"/><link name="c"/>\n{joint.format("b", "c")}\n</robot>'
    )
    (found,) = mistakes(tmp_path, text=f"{head}model: robot.urdf\n{tail}")
    assert found.startswith("3:1: model: ")
    assert "robot.urdf:3: link 'c' has no inertial with a mass" in found


def test_a_derived_robot_is_checked_at_its_own_lines(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(TEXT, encoding="utf-8")
    found = mistakes(
        tmp_path,
        text="""\
robid_robot: 1
base: base.yaml
effects:
  grease: {use: friction.stribeck, on: elbow}
  sand: {use: friction.stribeck, on: wrist, with: {speed: 0}}
""",
    )
    assert found == [
        "4:3: effects.grease: two has an effect of this label; change it under parameters, as "
        "effect.grease.<parameter>",
        "5:34: effects.sand.on: there is no axis, bearing or body 'wrist'; there are shoulder, elbow, shoulder_x, base",
        "5:52: effects.sand.with.speed: 0 is outside 0.01 to 100 rad/s",
    ]
    found = mistakes(
        tmp_path,
        text="""\
robid_robot: 1
base: base.yaml
parameters:
  gear_stiffness.shoulder: -1
  gear_stifness.shoulder: 1
  effect.grease.breakaway: 60
  friction.elbow.coulomb: 0.1
  friction.elbow.viscous: small
payload: 3
""",
    )
    assert found == [
        "4:3: parameters.gear_stiffness.shoulder: -1.0 must be greater than 0; gear_stiffness.shoulder: N m/rad",
        "5:3: parameters.gear_stifness.shoulder: two has no such parameter; did you mean 'gear_stiffness.shoulder'?",
        "6:3: parameters.effect.grease.breakaway: two: effects.grease: breakaway: 60 is outside 0 to 50 N m",
        "8:3: parameters.friction.elbow.viscous: 'small' is written here, it must be a number; parameters: Named "
        "parameters with other values than in the base",
        "9:1: payload: unknown key 'payload'; the keys here are: robid_robot, name, base, base_sha256, "
        "factors, parameters, effects",
    ]


def test_a_robot_is_not_its_own_base(tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text("robid_robot: 1\nbase: robot.yaml\n")
    (tmp_path / "robot.yaml").write_text("robid_robot: 1\nbase: other.yaml\n")
    with pytest.raises(
        FileProblems, match=r"^other.yaml:2:1: base: .*: robot.yaml -> other.yaml -> robot.yaml$"
    ):
        read_description(tmp_path / "robot.yaml")


def test_a_file_changed_at_random_is_read_or_refused_and_never_a_traceback(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    values = [
        "",
        "null",
        "true",
        "0",
        "-1",
        ".nan",
        "-.inf",
        "[]",
        "{}",
        "[1, 2]",
        "x",
        "[[1]]",
        "1e308",
        "elbow",
    ]
    sheet = "gear: {data_sheet: {K_nm_per_rad: 6.7e+4}}\n    bearing: {moment_rigidity_nm_per_rad: 1.0e+6}"
    text = TEXT.replace("gear: {stiffness: 8.0e+4, damping: 60}", sheet).replace("shoulder_x:", "hinge_x:")
    text = text.replace("{joint: shoulder, axis: [1, 0, 0]", "{joint: elbow, axis: [1, 0, 0]")
    words = list(re.finditer(r"[A-Za-z_0-9.+-]+|\[[^\]]*\]|\{[^}]*\}", text))
    told: list[str] = []
    path = tmp_path / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    read_description(path)
    for _ in range(200):
        word, value = words[rng.integers(len(words))], values[rng.integers(len(values))]
        path.write_text(text[: word.start()] + value + text[word.end() :], encoding="utf-8")
        try:
            read_description(path)
        except FileProblems as problems:
            told.append(str(problems))
    assert 100 < len(told) < 200
    lines = [line for message in told for line in message.split("\n")]
    assert all(re.match(r"robot\.yaml:\d+:\d+: ", line) for line in lines)


def test_a_urdf_or_a_folder_in_place_of_a_robot_file_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text("<robot/>")
    with pytest.raises(
        ConfigurationError, match=r"robid init FOLDER --robot .*arm\.urdf` makes a robot file of it"
    ):
        find_robot("arm.urdf", tmp_path)
    with pytest.raises(ConfigurationError, match="is a folder; name the robot file in it"):
        find_robot(".", tmp_path)
    with pytest.raises(ValueError, match=r"'arm\.urdf' is a URDF; `robid init FOLDER --robot arm\.urdf`"):
        robot_source("arm.urdf", Places(tmp_path, tmp_path, tmp_path, "the default"))
