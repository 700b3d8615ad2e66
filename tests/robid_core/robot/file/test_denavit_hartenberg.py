"""A Denavit-Hartenberg table becomes bodies on joints: held against the four elementary transforms, and pinocchio."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio
import pytest
from oracles.pinocchio_robot import PinocchioChain
from ruamel.yaml import YAML

from robid_core import ConfigurationError, Robot
from robid_core.robot.file.in_place import with_model
from robid_core.robot.file.reading import read_description
from robid_core.yaml_file.problems import FileProblems

FloatArray = npt.NDArray[np.float64]
CONVENTIONS = pytest.mark.parametrize("convention", ["classic", "modified"])
DRIVE = {"rotor_inertia": 1e-4}


def rotation_about(axis: int, angle: float) -> FloatArray:
    """4 x 4 transform that turns about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    t = np.eye(4)
    t[i, i], t[i, j], t[j, i], t[j, j] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return t


def translation_along(axis: int, length: float) -> FloatArray:
    """4 x 4 transform that goes along a coordinate axis."""
    t = np.eye(4)
    t[axis, 3] = length
    return t


def transform(convention: str, row: dict[str, Any], q: float) -> FloatArray:
    """From one link frame to the next, as the textbooks write it."""
    slides = row["type"] == "prismatic"
    about_z = rotation_about(2, row["offset"] + (0.0 if slides else q))
    along_z = translation_along(2, row["d"] + (q if slides else 0.0))
    along_x, about_x = translation_along(0, row["a"]), rotation_about(0, row["alpha"])
    if convention == "classic":
        return about_z @ along_z @ along_x @ about_x
    return about_x @ along_x @ about_z @ along_z


def orthonormal(rng: np.random.Generator) -> FloatArray:
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q *= np.sign(np.diag(r))
    return np.asarray(q * np.linalg.det(q))


def random_table(rng: np.random.Generator, convention: str, n: int = 6) -> dict[str, Any]:
    """A table with two prismatic axes, a turned base, and random bodies."""
    links = []
    for index in range(n):
        turn = orthonormal(rng)
        moments = turn @ np.diag(np.array([0.4, 0.5, 0.6]) * rng.uniform(0.5, 1.0)) @ turn.T
        d, a, alpha, offset = rng.uniform(-1, 1, 4) * (0.8, 0.8, np.pi, np.pi)
        links.append({
            "joint": f"j{index}", "type": "prismatic" if index in (1, 4) else "revolute", "d": d, "a": a,
            "alpha": alpha, "offset": offset, "mass": rng.uniform(1, 20),
            "centre_of_mass": rng.uniform(-0.5, 0.5, 3).tolist(), "inertia": (0.5 * (moments + moments.T)).tolist(),
        })  # fmt: skip
    base = {"rotation": orthonormal(rng).tolist(), "translation": rng.uniform(-1, 1, 3).tolist()}
    return {"convention": convention, "base": base, "links": links}


def robot_of(table: dict[str, Any], folder: Path) -> Robot:
    """The robot of a file with this table."""
    axes = {row["joint"]: DRIVE | {"gear_ratio": 50 + k} for k, row in enumerate(table["links"])}
    text = json.dumps({"robid_robot": 1, "name": "table", "dh": table, "axes": axes})  # JSON is YAML
    (folder / "robot.yaml").write_text(text)
    return Robot.load("robot.yaml", folder)


def base_of(table: dict[str, Any]) -> FloatArray:
    t = np.eye(4)
    t[:3, :3], t[:3, 3] = table["base"]["rotation"], table["base"]["translation"]
    return t


def link_frames(table: dict[str, Any], q: FloatArray) -> list[FloatArray]:
    """Every link frame in the base frame, by the product of the elementary transforms."""
    frames, t = [], base_of(table)
    for row, angle in zip(table["links"], q.tolist(), strict=True):
        t = t @ transform(table["convention"], row, angle)
        frames.append(t)
    return frames


def joint_frames(robot: Robot, q: FloatArray) -> list[FloatArray]:
    """Every joint's frame in the base frame, from the description alone."""
    frames: dict[str | None, FloatArray] = {None: np.eye(4)}
    for body, angle in zip(robot.description.bodies, q.tolist(), strict=True):
        place, move = np.eye(4), np.eye(4)
        place[:3, :3], place[:3, 3] = body.rotation, body.translation
        if body.type == "prismatic":
            move[:3, 3] = angle * np.array(body.axis)
        else:
            move[:3, :3] = pinocchio.exp3(angle * np.array(body.axis))
        frames[body.joint] = frames[body.parent] @ place @ move
    return [frame for name, frame in frames.items() if name is not None]


def pinocchio_of(table: dict[str, Any]) -> pinocchio.Model:
    """The same chain built from the transforms: joints turn about the z of the frame before (classic), or own z.

    What lies between two joints is the transform at q = 0 less the joint's own part, which stands first (classic) or
    last but for the length along z, with which it commutes (modified).
    """
    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    before, parent = base_of(table), 0
    for row in table["links"]:
        rest = transform(table["convention"], row, 0.0)
        placement, link = (before, rest) if table["convention"] == "classic" else (before @ rest, np.eye(4))
        joint = pinocchio.JointModelPZ() if row["type"] == "prismatic" else pinocchio.JointModelRZ()
        parent = model.addJoint(
            parent, joint, pinocchio.SE3(placement[:3, :3], placement[:3, 3]), row["joint"]
        )
        inertia = pinocchio.Inertia(row["mass"], np.array(row["centre_of_mass"]), np.array(row["inertia"]))
        model.appendBodyToJoint(parent, inertia, pinocchio.SE3(link[:3, :3], link[:3, 3]))
        before = link
    return model


@CONVENTIONS
def test_forward_kinematics_is_the_product_of_the_elementary_transforms(
    convention: str, tmp_path: Path
) -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        table = random_table(rng, convention)
        robot = robot_of(table, tmp_path)
        for q in rng.uniform(-np.pi, np.pi, (10, 6)):
            for row, ours, theirs in zip(
                table["links"], joint_frames(robot, q), link_frames(table, q), strict=True
            ):
                if convention == "classic":  # the joint's frame stands a before the link's
                    ours = ours @ translation_along(0, row["a"])
                np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@CONVENTIONS
def test_gravity_and_inverse_dynamics_are_those_of_the_transforms_in_pinocchio(
    convention: str, tmp_path: Path
) -> None:
    for seed in range(3):
        rng = np.random.default_rng(100 + seed)
        table = random_table(rng, convention)
        robot, model = robot_of(table, tmp_path), pinocchio_of(table)
        chain, data = PinocchioChain(robot.chain), model.createData()
        for _ in range(10):
            q, v, a = rng.uniform(-2, 2, (3, 6))
            gravity = pinocchio.computeGeneralizedGravity(model, data, q)
            ours = robot.gravity_torque(q[None])[0] * (50 + np.arange(6))  # gears are rigid
            np.testing.assert_allclose(ours, gravity, rtol=1e-9, atol=1e-9 * np.abs(gravity).max())
            force = pinocchio.rnea(model, data, q, v, a)
            np.testing.assert_allclose(
                chain.force(q, v, a), force, rtol=1e-9, atol=1e-9 * np.abs(force).max()
            )


@CONVENTIONS
def test_degrees_and_inertia_about_the_origin_say_the_same(convention: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    table = random_table(rng, convention)
    other = json.loads(json.dumps(table))
    for row in other["links"]:
        row["alpha_deg"], row["offset_deg"] = (float(np.degrees(row.pop(key))) for key in ("alpha", "offset"))
        c, m = np.array(row["centre_of_mass"]), row["mass"]
        cross = pinocchio.skew(c)
        row["inertia_about_origin"] = (np.array(row.pop("inertia")) - m * cross @ cross).tolist()
    ours, theirs = (robot_of(t, tmp_path).description for t in (table, other))
    for one, two in zip(ours.bodies, theirs.bodies, strict=True):
        for name in ("axis", "translation", "rotation", "mass", "centre_of_mass", "inertia"):
            np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0, atol=1e-12)


def test_quarter_turns_are_exact(tmp_path: Path) -> None:
    links = [{"joint": "a", "alpha_deg": 90, "offset_deg": -90, "a": 0.5, "mass": 1}]
    (body,) = robot_of({"convention": "classic", "links": links}, tmp_path).description.bodies
    assert body.axis == (0.0, 1.0, 0.0)
    assert body.rotation == ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert body.centre_of_mass == (0.5, 0.0, 0.0)
    assert "-0.0" not in repr(body)


TEXT = """\
robid_robot: 1
name: arm
dh:
  convention: classic
  links:
    - {joint: shoulder, d: 0.4, a: 0.1, alpha_deg: 90, mass: 12, centre_of_mass: [-0.05, 0.1, 0]}
    - joint: elbow
      a: 0.6
      mass: 8
      centre_of_mass: [-0.3, 0, 0]
      inertia: [[0.02, 0, 0], [0, 0.3, 0], [0, 0, 0.3]]
axes:
  shoulder: {rotor_inertia: 1.0e-3, gear_ratio: 100}
  elbow: {rotor_inertia: 5.0e-4, gear_ratio: 80}
"""


def test_what_stands_on_bodies_stands_on_a_table(tmp_path: Path) -> None:
    """The written robot is the same one; a derived robot, parameter names and adoption work on it."""
    (tmp_path / "arm.yaml").write_text(TEXT)
    robot = Robot.load("arm.yaml", tmp_path)
    (tmp_path / "written.yaml").write_text(robot.to_yaml())
    assert "dh" not in robot.to_yaml()
    assert Robot.load("written.yaml", tmp_path) == robot
    assert robot.parameter("centre_of_mass.elbow.x") == pytest.approx(0.3, abs=1e-15)
    assert robot.parameter("inertia.elbow.yy") == 0.3
    (tmp_path / "heavier.yaml").write_text(
        "robid_robot: 1\nbase: arm.yaml\nparameters: {mass.elbow: 9.5}\n"
        "effects: {tool: {use: load.payload, on: elbow, with: {mass: 2.0}}}\n"
    )
    heavier = Robot.load("heavier.yaml", tmp_path)
    assert heavier.chain.mass[1] == pytest.approx(11.5)
    adopted = with_model(TEXT, tmp_path / "arm.yaml", robot.model({"gear_ratio.elbow": 81.5}))
    assert adopted == TEXT.replace("gear_ratio: 80", "gear_ratio: 81.5")


@CONVENTIONS
def test_what_a_fit_finds_of_a_body_is_adopted_into_the_table(convention: str, tmp_path: Path) -> None:
    """The table has the classic link frame's centre of mass, `a` before that of the joint's frame."""
    text = TEXT.replace("classic", convention)
    (tmp_path / "arm.yaml").write_text(text)
    robot = Robot.load("arm.yaml", tmp_path)
    middle = 0.05 if convention == "classic" else -0.55
    values = {
        "mass.shoulder": 12.25, "mass.elbow": 8.5, "centre_of_mass.elbow.x": middle, "centre_of_mass.elbow.y": 0.01,
        "inertia.elbow.xx": 0.03, "inertia.elbow.yz": 0.002,
    }  # fmt: skip
    adopted = with_model(text, tmp_path / "arm.yaml", robot.model(values))
    links = YAML(typ="safe", pure=True).load(adopted)["dh"]["links"]
    assert [row["mass"] for row in links] == [12.25, 8.5]
    assert links[1]["centre_of_mass"] == pytest.approx([-0.55, 0.01, 0.0], abs=1e-15)
    assert links[1]["inertia"] == [[0.03, 0, 0], [0, 0.3, 0.002], [0, 0.002, 0.3]]
    (tmp_path / "arm.yaml").write_text(adopted)
    found = Robot.load("arm.yaml", tmp_path)
    for name, value in values.items():
        assert found.parameter(name) == pytest.approx(value, abs=1e-15)


def test_an_inertia_about_the_origin_takes_no_inertia_about_the_centre_of_mass(tmp_path: Path) -> None:
    text = TEXT.replace(
        "inertia: [[0.02, 0, 0], [0, 0.3, 0], [0, 0, 0.3]]",
        "inertia_about_origin: [[0.5, 0, 0], [0, 1, 0], [0, 0, 1]]",
    )
    (tmp_path / "arm.yaml").write_text(text)
    robot = Robot.load("arm.yaml", tmp_path)
    with pytest.raises(ConfigurationError, match=r"there is no place of its own for inertia.elbow.xx"):
        with_model(text, tmp_path / "arm.yaml", robot.model({"inertia.elbow.xx": 0.51}))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("  convention: classic\n", "", "3:1: dh.convention: the key 'convention' is missing: Order of the"),
        ("classic", "craig", "4:3: dh.convention: 'craig' must be 'classic' or 'modified'"),
        ("a: 0.6", "a: far", "8:7: dh.links[1].a: joint 'elbow': 'far' is written here, it must be a number; a:"),
        ("a: 0.6", "length: 0.6", "8:7: dh.links[1].length: joint 'elbow': unknown key 'length'"),
        ("alpha_deg: 90", "alpha_deg: 90, alpha: 1.5", "6:7: dh.links[0]: joint 'shoulder': alpha and alpha_deg are"),
        (
            "alpha_deg: 90",
            "alpha: 90",
            "6:7: dh.links[0]: joint 'shoulder': alpha 90 rad is 14.3 turns; degrees? Write alpha_deg: 90, or",
        ),
        (
            "alpha_deg: 90",
            "alpha: 1.5707963, offset: -90",
            "6:7: dh.links[0]: joint 'shoulder': offset -90 rad is 14.3 turns; degrees? Write offset_deg: -90",
        ),
        ("[0, 0.3, 0]", "[0, 0.4, 0]", "11:7: dh.links[1].inertia: joint 'elbow': principal moments 0.02, 0.3, 0.4"),
        ("    - joint: elbow", "    - joint: shoulder", "7:7: dh.links[1].joint: joint 'shoulder': stands twice"),
        ("  elbow: {", "  wrist: {", "14:3: axes.wrist.joint: there is no joint 'wrist' to move; there are"),
        ("      mass: 8\n", "", "10:7: bodies[1].inertia: joint 'elbow': a body of mass 0 has an inertia of"),
        ("axes:\n", "bodies: []\naxes:\n", "3:1: dh: bodies and a Denavit-Hartenberg table are given; keep one"),
        ("axes:\n", "model: arm.urdf\naxes:\n", "dh: bodies and a Denavit-Hartenberg table are given; keep one of the"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_told_at_its_place(old: str, new: str, told: str, tmp_path: Path) -> None:
    assert TEXT.count(old) == 1, old
    (tmp_path / "robot.yaml").write_text(TEXT.replace(old, new))
    with pytest.raises(FileProblems) as refused:
        read_description(tmp_path / "robot.yaml")
    lines = str(refused.value).split("\n")
    assert any(told in line for line in lines), lines
    assert not any("dh.links: " in line for line in lines), lines


def test_a_body_that_cannot_be_about_the_origin_is_refused(tmp_path: Path) -> None:
    """8 kg at 0.3 m have 0.72 kg m^2 about the origin at least."""
    text = TEXT.replace("inertia: [[0.02", "inertia_about_origin: [[0.02")
    (tmp_path / "robot.yaml").write_text(text)
    with pytest.raises(
        FileProblems,
        match=r"7:7: dh.links\[1\]: joint 'elbow': inertia_about_origin less mass and "
        "centre of mass: a principal moment is -0.42",
    ):
        read_description(tmp_path / "robot.yaml")


def test_a_table_gives_no_fields_that_bodies_do_not_have(tmp_path: Path) -> None:
    """The description is that of a file with bodies: nothing in it tells of the table."""
    table = random_table(np.random.default_rng(3), "classic")
    robot = robot_of(table, tmp_path)
    assert set(robot.description.model_dump()) == set(Robot.load("one_axis").description.model_dump())
    assert dataclasses.replace(robot).sha256 == robot.sha256
