"""Robot files as people get them wrong: what `robid validate`, `doctor` and `show` say, where, and how they end.

A case changes a sound file. Each command ends within seconds with exit code 2 and says the line, the key and what to
do; numbers that are only hard to believe are remarked. Mistakes of single keys are in test_wrong_robot_files.py.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from robid_core.commands import main
from robid_core.robot.file.reading import PACKAGED, find_robot

ONE = find_robot("one_axis").read_text()
SIX = find_robot("six_axis").read_text()
URDF = (PACKAGED / "six_axis" / "robot.urdf").read_text()
PIPELINE = """\
robid: 1
name: example
seed: 1
robot: robot.yaml
drives: {{use: simulated, with: {{plant: {}}}}}
stages:
  where: {{use: design.candidates, with: {{count: 3}}}}
"""
LONGEST_S = 5.0

Files = dict[str, str | bytes]


class Done(NamedTuple):
    """How a command ended."""

    code: int
    said: str


@pytest.fixture(name="robid")
def command_in_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Return a function that runs a command line in this process, in a folder with some files."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Done:
        began = time.process_time()
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert time.process_time() - began < LONGEST_S
        out, err = capfd.readouterr()
        assert "Traceback" not in out + err
        return Done(int(end.value.code or 0), out + err)

    return run


Robid = Callable[..., Done]


def write(folder: Path, files: Files) -> None:
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    plant = "six_axis_true" if files.get("robot.yaml") == SIX else "one_axis_true"
    (folder / "pipeline.yaml").write_text(PIPELINE.format(plant))


def one(*changes: tuple[str, str], text: str = ONE) -> Files:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return {"robot.yaml": text}


def urdf(pattern: str, new: str, count: int = 1) -> Files:
    text, found = re.subn(pattern, new, URDF, count=count)
    assert found
    return {"robot.yaml": SIX, "robot.urdf": text}


def key(name: str, value: str) -> Files:
    """The one-axis robot with another value of a key."""
    text, found = re.subn(rf"\b{name}: [^,}}\n]+", f"{name}: {value}", ONE, count=1)
    assert found
    return {"robot.yaml": text}


def derived(rest: str) -> Files:
    return {"robot.yaml": f"robid_robot: 1\n{rest}\n"}


INERTIA = "[[3.5, 0, 0], [0, 3.5, 0], [0, 0, 0.2]]"
SERVO = "servo: {duty_gain: 1e15, supply_voltage: 12, resistance: 1}"
EFFECT = "effects: {{a: {{use: {}}}}}\naxes:"
BLOWN_UP = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n" for old, new in pairwise("abcdefghi")
)
THREE_HUNDRED = "\n".join(
    [
        "robid_robot: 1\nname: x\nbodies:",
        *(f"  - {{joint: a{n}}}" for n in range(300)),
        "axes:",
        *(f"  a{n}: {{rotor_inertia: 1}}" for n in range(300)),
    ]
)
BASES: Files = {f"r{n}.yaml": f"robid_robot: 1\nbase: r{n + 1}.yaml\n" for n in range(1200)}
BASES["robot.yaml"] = "robid_robot: 1\nbase: r0.yaml\n"
ENTITIES = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 10))
BOMB = f'<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a0 "lol">{ENTITIES}]><robot name="&a9;"/>'
POINT = "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]"

# What the file is, and what is said of it: line and column, then words.
REFUSED: dict[str, tuple[Files, tuple[str, ...]]] = {
    "ratio as 1:100": (key("gear_ratio", "1:100"), ("14:5", "'1:100' is written here, it must be a number")),
    "ratio as a fraction": (key("gear_ratio", "1/100"), ("14:5", "it must be a number")),
    "decimal comma": (key("mass", "40,5"), ("8:5", "'40,5' is written here")),
    "thousands by underscore": (key("speed_limit", "4_000"), ("18:5", "'4_000' is written here")),
    "number with its unit": (key("mass", "40 kg"), ("8:5", "'40 kg' is written here")),
    "nan without a dot": (key("mass", "nan"), ("8:5", "'nan' is written here")),
    "infinite by its exponent": (key("mass", "1e400"), ("8:5", "it must be a finite number")),
    "not a number": (key("damping", ".nan"), ("19:31", "it must be a finite number")),
    "1e300": (key("stiffness", "1e300"), ("19:12", "must be at most 1e+15")),
    "1e-300": (key("rotor_inertia", "1e-300"), ("15:5", "1e-300 is too small", "is the unit right?")),
    "a servo beyond numbers": (
        one(("controller: {speed_gain: 0.08, integral_gain: 0.64}", SERVO)),
        ("22:5", "duty_gain 1e+15 1/rad at 12 V", "give duty cycle per rad"),
    ),
    "sample time in Hz": (
        one(("name: one_axis", "name: x\nsample_time_s: 1000")),
        ("4:1", "not a rate in Hz"),
    ),
    "sample time of 1e-300": (
        one(("name: one_axis", "name: x\nsample_time_s: 1e-300")),
        ("4:1", "too small"),
    ),
    "step of femtoseconds": (
        one(("name: one_axis", "name: x\nstep_s: 1e-14")),
        ("4:1", "1e+11 steps in a sample"),
    ),
    "inertia as six numbers": (one((INERTIA, "[3.5, 3.5, 0.2, 0, 0, 0]")), ("10:5", "6 entries")),
    "inertia as three numbers": (
        one((INERTIA, "[3.5, 3.5, 0.2]")),
        ("10:5", "[[3.5, 0, 0], [0, 3.5, 0], [0"),
    ),
    "rotation as angles": (
        one(("    mass:", "    rotation: [0, 1.57, 0]\n    mass:")),
        ("8:5", "three rows of a matrix are wanted, no angles"),
    ),
    "axis as a letter": (one(("axis: [0, 1, 0]", "axis: y")), ("7:5", "it must be a list")),
    "limits as one number": (one(("[-2.0, 2.0]", "2.0")), ("13:5", "it must be a list")),
    "limits as expressions": (one(("[-2.0, 2.0]", "[-pi/2, pi/2]")), ("13:23", "'-pi/2' is written here")),
    "minus sign of a typesetter": (one(("[-2.0", "[\u22122.0")), ("13:23", "it must be a number")),
    "gear none": (one(("gear: {stiffness: 8.0e+4, damping: 60}", "gear: none")), ("19:5", "null: rigid")),
    "friction as one number": (
        one(("{coulomb: 0.5, viscous: 2.5e-3}", "0.5")),
        ("20:5", "it must be a mapping"),
    ),
    "axis called 1": (one(("joint: axis_1", "joint: 1"), ("  axis_1:", "  1:")), ("6:5", "it must be text")),
    "name without text": (one(("name: one_axis", "name:")), ("3:1", "it must be text")),
    "tab before a key": (one(("    gear_ratio", "\tgear_ratio")), ("14:1", "'\\t'")),
    "colon without a space": (one(("gear_ratio: 100", "gear_ratio:100")), ("15:5", "line 14")),
    "bracket that never closes": (one(("2.0]", "2.0")), ("14:15", "begins at line 13")),
    "key twice": (one(("axes:", "axes: {}\naxes:")), ("12:1", "repeated key 'axes'")),
    "anchor inside its value": (
        one(("gravity: [", "gravity: &g [*g, ")),
        ("4:14", "stands inside the value it repeats"),
    ),
    "tag of Python": (key("mass", "!!python/object/apply:os.system [ls]"), ("8:11", "is refused")),
    "bodies called links": (one(("bodies:", "links:")), ("5:1", "unknown key 'links'")),
    "centre of mass called com": (one(("centre_of_mass", "com")), ("9:5", "unknown key 'com'")),
    "continuous joint": (
        one(("    axis:", "    type: continuous\n    axis:")),
        ("7:5", "'revolute' or 'prismatic'"),
    ),
    "effect on the base": (
        one(("axes:", EFFECT.format("friction.lugre, on: base"))),
        ("11:36", "no axis 'base'; there are axis_1"),
    ),
    "effect on no such side": (
        one(("axes:", EFFECT.format("friction.lugre, on: axis_1, side: torque"))),
        ("11:48", "no side 'torque'; it has motor"),
    ),
    "effect on a rigid gear": (
        one(
            ("axes:", EFFECT.format("transmission.backlash, on: axis_1")),
            ("    gear: {stiffness: 8.0e+4, damping: 60}\n", ""),
        ),
        ("11:43", "the gear of axis_1 is rigid"),
    ),
    "effect that is a stage": (one(("axes:", EFFECT.format("frf.log"))), ("11:15", "no effect 'frf.log'")),
    "model as a list": (one(("robot.urdf", "[robot.urdf]"), text=SIX), ("4:1", "no text is written here")),
    "model without a name": (
        one(("model: robot.urdf", "model:"), text=SIX),
        ("4:1", "nothing is written here; name a model"),
    ),
    "model that is a folder": (one(("robot.urdf", "."), text=SIX), ("4:1", "is no file")),
    "pipeline in its place": (
        {"robot.yaml": PIPELINE.format("one_axis_true")},
        ("1:1", "a pipeline file, where a robot file is wanted"),
    ),
    "nothing but a comment": ({"robot.yaml": "# robot\n"}, ("1:1", "the file is empty")),
    "UTF-16": ({"robot.yaml": ONE.encode("utf-16")}, ("1:1", "save the file as UTF-8")),
    "Latin 1": (
        {"robot.yaml": ONE.replace("one_axis", "Ger\u00e4t").encode("latin-1")},
        ("3:10", "not UTF-8"),
    ),
    "bytes": ({"robot.yaml": bytes(range(256)) * 30}, ("3:115", "not UTF-8")),
    "list at the top": ({"robot.yaml": "- robid_robot: 1\n"}, ("1:1", "holds keys and values")),
    "URDF in its place": ({"robot.yaml": URDF}, ("not YAML",)),
    "too many bytes": ({"robot.yaml": b"#" + b"x" * 2_000_000}, ("1:1", "2000001 bytes")),
    "nested without end": ({"robot.yaml": "{a: " * 20_000}, ("1:129", "nested deeper than 32 levels")),
    "aliases that blow up": (
        {"robot.yaml": BLOWN_UP},
        ("with its aliases written out",),
    ),
    "base that is itself": (derived("base: robot.yaml"), ("2:1", "cannot be its own base")),
    "bases without end": (
        BASES,
        ("r15.yaml:2:1", "more than 16 robots, each the base of the one before"),
    ),
    "base that does not exist": (derived("base: six_axes"), ("2:1", "did you mean 'six_axis'?")),
    "base as a number": (derived("base: 6"), ("2:1", "it must be text")),
    "base with other axes": (derived("base: six_axis\naxes: {}"), ("3:1", "unknown key 'axes'")),
    "three hundred joints": (
        {"robot.yaml": THREE_HUNDRED},
        ("there must be at most 100",),
    ),
}

IMPOSSIBLE: dict[str, tuple[Files, tuple[str, ...]]] = {
    "degrees": (one(("[-2.0, 2.0]", "[-115, 115]")), ("13:5: axes.axis_1.position_limits", "degrees?")),
    "millimetres": (
        one(("[0.05, 0, 0.5]", "[50, 0, 500]")),
        ("17:5: axes.axis_1.torque_limit", "gravity asks for"),
    ),
    "grams": (key("mass", "40000"), ("17:5: axes.axis_1.torque_limit", "gravity asks for")),
    "grams in a derived file": (
        derived("base: one_axis\nparameters: {mass.axis_1: 40000}"),
        ("2:1", "gravity asks for"),
    ),
    "kg mm^2": (
        one((INERTIA, "[[3.5e6, 0, 0], [0, 3.5e6, 0], [0, 0, 2.0e5]]")),
        ("10:5", "radius of gyration", "kg mm^2?"),
    ),
    "gravity in mm/s^2": (one(("-9.81", "-9810")), ("4:1: gravity", "mm/s^2")),
    "ratio upside down": (
        key("gear_ratio", "0.01"),
        ("17:5: axes.axis_1.torque_limit", "ratio at the motor?"),
    ),
    "friction at the joint": (
        key("coulomb", "50"),
        ("20:16: axes.axis_1.friction.coulomb", "is it at the motor?"),
    ),
    "noise above the limit": (
        key("torque_noise", "1000"),
        ("21:64: axes.axis_1.sensors.torque_noise", "more than the"),
    ),
    "gain a thousand times": (
        key("speed_gain", "80"),
        ("11:1: axes", "the controller is unstable", "lower its speed_gain"),
    ),
    "body without mass": (
        one(("mass: 40", "mass: 0"), (INERTIA, POINT)),
        ("5:1: bodies", "nothing that 'axis_1' moves"),
    ),
    "point on its axis": (
        one(("[0.05, 0, 0.5]", "[0, 0, 0]"), (INERTIA, POINT)),
        ("5:1: bodies", "give mass"),
    ),
}

REMARKED: dict[str, tuple[Files, str]] = {
    "kg cm^2": (key("rotor_inertia", "12"), "axes.axis_1.rotor_inertia: .*1 kg cm.2 = 1e-4"),
    "N mm/rad": (key("stiffness", "8.0e+7"), "axes: the first resonance.*too stiff"),
    "kN m/rad": (key("stiffness", "80"), "axes: the first resonance.*stiffness in N m/rad"),
    "mN m/A": (key("torque_constant", "10000"), "axes.axis_1.torque_constant: .*not mN m/A"),
    "torque at the joint": (
        key("torque_limit", "2000"),
        "axes.axis_1.torque_limit: .*is the torque at the motor",
    ),
    "turns a minute": (key("speed_limit", "3820"), "axes.axis_1.speed_limit: .*were turns a minute written"),
    "viscous at the joint": (key("viscous", "25"), "axes.axis_1.friction.viscous: .*at the motor"),
    "noise in degrees": (
        key("position_noise", "0.5"),
        "axes.axis_1.sensors.position_noise: .*in rad at the motor",
    ),
}

BROKEN_URDF: dict[str, tuple[Files, tuple[str, ...]]] = {
    "nothing in it": ({"robot.yaml": SIX, "robot.urdf": ""}, ("robot.urdf",)),
    "cut": ({"robot.yaml": SIX, "robot.urdf": URDF[: len(URDF) // 2]}, ("robot.urdf",)),
    "a page of a server": ({"robot.yaml": SIX, "robot.urdf": "<html><body>404</body></html>"}, ("robot",)),
    "bytes": ({"robot.yaml": SIX, "robot.urdf": bytes(range(256)) * 30}, ("robot.urdf",)),
    "UTF-16 of a body": ({"robot.yaml": SIX, "robot.urdf": URDF.encode("utf-16")[:-1]}, ("robot.urdf",)),
    "mass that is no number": (urdf(r'mass value="[^"]+"', 'mass value="nan"'), ("mass",)),
    "decimal comma": (urdf(r'mass value="([0-9]+)[^"]*"', r'mass value="\1,5"'), ("mass",)),
    "two coordinates": (urdf(r'xyz="[^"]+"', 'xyz="0 1"'), ("robot.urdf", "three numbers in m")),
    "negative moments": (urdf(r'ixx="', 'ixx="-'), ("robot.urdf:13", "none may be negative")),
    "bombs of entities": (
        {"robot.yaml": SIX, "robot.urdf": BOMB},
        ("robot.urdf",),
    ),
    "axis of no joint": (
        {**one(("  axis_3:\n", "  axis3:\n"), text=SIX), "robot.urdf": URDF},
        ("axes.axis3.joint", "no joint 'axis3'"),
    ),
    "joint without an axis": (
        {"robot.yaml": SIX[: SIX.index("  axis_6:")] + SIX[SIX.index("bearings:") :], "robot.urdf": URDF},
        ("joint 'axis_6' has no drive",),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_robot_file_is_refused_by_every_command(name: str, tmp_path: Path, robid: Robid) -> None:
    files, words = REFUSED[name]
    write(tmp_path, files)
    for arguments in (("validate",), ("doctor", "robot.yaml")):
        done = robid(*arguments)
        assert done.code == 2
        assert all(word in done.said for word in words), done.said
    shown = robid("show", "robot.yaml")
    assert shown.code == 2
    assert shown.said.count("\n") <= 2
    assert ": " in shown.said


@pytest.mark.parametrize("name", BROKEN_URDF)
def test_a_broken_urdf_is_told_at_the_robot_file(name: str, tmp_path: Path, robid: Robid) -> None:
    pytest.importorskip("pinocchio")
    files, words = BROKEN_URDF[name]
    write(tmp_path, files)
    for arguments in (("validate",), ("doctor", "robot.yaml")):
        done = robid(*arguments)
        assert done.code == 2
        assert "robot.yaml:" in done.said
        assert all(word in done.said for word in words), done.said


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_a_robot_that_cannot_be_is_refused_before_anything_runs(
    name: str, tmp_path: Path, robid: Robid
) -> None:
    files, words = IMPOSSIBLE[name]
    write(tmp_path, files)
    for arguments in (("validate",), ("run",), ("doctor", "robot.yaml")):
        done = robid(*arguments)
        assert done.code == 2
        assert all(word in done.said for word in words), done.said
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("name", REMARKED)
def test_what_is_hard_to_believe_is_remarked(name: str, tmp_path: Path, robid: Robid) -> None:
    files, pattern = REMARKED[name]
    write(tmp_path, files)
    for arguments in (("validate",), ("doctor", "robot.yaml")):
        done = robid(*arguments)
        assert done.code == 0
        assert re.search(pattern, done.said), done.said


def test_a_factor_in_per_cent_is_remarked_at_its_line(tmp_path: Path, robid: Robid) -> None:
    files = derived("base: one_axis\nfactors: {gear_stiffness.*: 75, gear_damping.*: 2}")
    write(tmp_path, files)
    told = "factors.gear_stiffness.*: 75 times what the base has; per cent? 75 % are 0.75"
    assert told in robid("validate").said
    said = robid("doctor", "robot.yaml").said
    assert f"note robot.yaml:3:11: {told}" in said
    assert "2 times" not in said


def test_a_truth_in_place_of_the_robot_is_remarked(tmp_path: Path, robid: Robid) -> None:
    write(tmp_path, {})
    pipeline = tmp_path / "pipeline.yaml"
    pipeline.write_text(re.sub("robot: .*", "robot: one_axis_true", pipeline.read_text(), count=1))
    assert "one_axis_true is the truth behind simulated drives" in robid("validate").said


def test_what_is_said_of_a_table_points_to_its_row(tmp_path: Path, robid: Robid) -> None:
    table = """robid_robot: 1
name: lab
dh:
  convention: classic
  links:
    - {joint: axis_1, d: 400, mass: 20, inertia: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
axes:
  axis_1: {gear_ratio: 121, rotor_inertia: 2.5e-3}
"""
    write(tmp_path, {"robot.yaml": table})
    assert "robot.yaml:6:7: bodies[0] (axis_1).translation: 400 m long" in robid("doctor", "robot.yaml").said


def test_recordings_and_robots_are_no_results(tmp_path: Path, robid: Robid) -> None:
    write(tmp_path, {"robot.yaml": ONE, "log.csv": "t,q\n0,1\n"})
    assert "a robot file, where a pipeline file is wanted; `robid doctor`" in robid("show", "robot.yaml").said
    assert "a robot file, where a pipeline file is wanted" in robid("validate", "robot.yaml").said
    assert "`robid records log.csv` says what it holds" in robid("show", "log.csv").said
    assert (
        "a pipeline file, where a robot file is wanted; `robid validate`"
        in robid("doctor", "pipeline.yaml").said
    )
