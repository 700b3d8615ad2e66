"""A robot written as URDF: what pinocchio and the <robid> elements say of the file is the robot's own model."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from robid_core import ConfigurationError, Robot
from robid_core.mechanics import dynamics
from robid_core.robot.file.description import FlexibleLink, RobotDescription
from robid_core.robot.urdf import robot_to_urdf, roll_pitch_yaw
from robid_pin.urdf import model_from_urdf

FloatArray = npt.NDArray[np.float64]


def random_robot(seed: int, n: int, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> Robot:
    """Draw a tree with elastic and rigid gears, bearings, prismatic axes, limits and none, a coupled last pair."""
    rng = np.random.default_rng(seed)
    bodies: list[dict[str, Any]] = []
    axes: dict[str, Any] = {}
    bearings: dict[str, Any] = {}
    for j in range(n):
        name, spread = f"axis_{j + 1}", rng.uniform(0.01, 0.3, 3)
        turned = Rotation.random(random_state=rng).as_matrix()
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        inertia = turned @ np.diag(spread.sum() - spread) @ turned.T
        bodies.append(
            {
                "joint": name,
                "parent": [None, *axes][rng.integers(j + 1)],
                "type": "prismatic" if j % 3 == 2 else "revolute",
                "axis": tuple(direction.tolist()),
                "translation": tuple(rng.uniform(-0.5, 0.5, 3).tolist()),
                "rotation": tuple(map(tuple, Rotation.random(random_state=rng).as_matrix().tolist())),
                "mass": float(rng.uniform(1, 20)),
                "centre_of_mass": tuple(rng.uniform(-0.2, 0.2, 3).tolist()),
                "inertia": tuple(map(tuple, (0.5 * (inertia + inertia.T)).tolist())),
            }
        )
        axes[name] = {
            "gear_ratio": float(rng.choice([-1, 1]) * rng.uniform(20, 120)),
            "rotor_inertia": float(rng.uniform(1e-4, 1e-3)),
            "torque_limit": 10.0,
            "speed_limit": 300.0,
            "controller": {"speed_gain": 0.1},
            "friction": {"coulomb": 0.3, "viscous": 2e-3},
        }
        if j % 2 == 0:
            axes[name]["position_limits"] = (-1.5, 2.5)
        if j % 4 != 3:
            axes[name]["gear"] = {
                "stiffness": float(rng.uniform(1e4, 1e5)),
                "damping": float(rng.uniform(1, 20)),
            }
        if j % 2 == 0:
            across = np.cross(direction, rng.normal(size=3))
            for k, axis in enumerate((across, np.cross(direction, across))):
                bearings[f"{name}_{'xy'[k]}"] = {
                    "joint": name,
                    "axis": tuple((axis / np.linalg.norm(axis)).tolist()),
                    "stiffness": float(rng.uniform(1e5, 1e6)),
                    "damping": float(rng.uniform(10, 100)),
                }
    gear = np.diag([1 / axis["gear_ratio"] for axis in axes.values()])
    if n > 1:
        gear[-1, -2] = 0.4 * gear[-1, -1]
    return Robot(
        RobotDescription.model_validate(
            {
                "robid_robot": 1, "name": "drawn", "gravity": gravity, "bodies": bodies, "axes": axes,
                "bearings": bearings, "coupling": tuple(map(tuple, gear.tolist())),
            }
        )
    )  # fmt: skip


def read_back(
    text: str, gravity: FloatArray
) -> tuple[pinocchio.Model, list[str], dict[str, ElementTree.Element]]:
    """Return pinocchio's model, the names of its coordinates in order, and the joints of the text."""
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = gravity
    names = [""] * model.nv
    for j in range(1, model.njoints):
        names[model.joints[j].idx_v] = model.names[j]
    root = ElementTree.fromstring(text)
    return model, names, {str(joint.get("name")): joint for joint in root.findall("joint")}


def mass_and_gravity(model: pinocchio.Model, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    data = model.createData()
    q = pinocchio.integrate(model, pinocchio.neutral(model), step)
    upper = np.triu(pinocchio.crba(model, data, q))
    return upper + np.triu(upper, 1).T, pinocchio.computeGeneralizedGravity(model, data, q)


@pytest.mark.parametrize("n", [1, 2, 3, 6, 9, 12])
def test_pinocchio_reads_the_mass_matrix_and_gravity_of_the_chain(n: int) -> None:
    """A joint of the chain turns by its joint in the file plus its gear's deflection."""
    robot = random_robot(n, n)
    model, names, joints = read_back(robot_to_urdf(robot), robot.chain.gravity)
    assert len(joints) == len(names) == robot.chain.n_coordinate + int(robot.mechanism.elastic_gear.sum())
    angles = np.zeros((robot.chain.n_coordinate, len(names)))
    for column, name in enumerate(names):
        angles[robot.chain.index(name.removesuffix("_gear")), column] = 1.0
    rng = np.random.default_rng(n)
    for _ in range(3):
        step = rng.normal(size=len(names))
        mass, gravity = mass_and_gravity(model, step)
        ours = dynamics(robot.chain, angles @ step, np.zeros(robot.chain.n_coordinate))
        np.testing.assert_allclose(angles.T @ ours.mass @ angles, mass, rtol=0, atol=1e-12 * abs(mass).max())
        np.testing.assert_allclose(angles.T @ ours.bias, gravity, rtol=0, atol=1e-12 * abs(gravity).max())


@pytest.mark.parametrize("n", [1, 4, 6])
def test_the_file_holds_the_whole_linear_model(n: int) -> None:
    """Mass from pinocchio, rotors and springs from <robid>, dampers from <dynamics>: (2.3) without gravity.

    Coordinates of the file u follow from those of the robot z = [motors; free joints] by u = U z.
    """
    robot = random_robot(10 + n, n, gravity=(0.0, 0.0, 0.0))
    text = robot_to_urdf(robot)
    model, names, joints = read_back(text, np.zeros(3))
    own = robot.mechanism.coordinate_names
    u = np.zeros((len(names), len(own)))
    rotors, springs, dampers = np.zeros(len(own)), np.zeros(len(names)), np.zeros(len(names))
    for row, name in enumerate(names):
        said = joints[name].find("robid")
        assert said is not None
        dynamic = joints[name].find("dynamics")
        assert dynamic is not None
        if "gear_row" in said.attrib:
            u[row, :n] = [float(number) for number in said.attrib["gear_row"].split()]
            rotors[robot.axis_names.index(said.attrib["axis"])] = float(said.attrib["rotor_inertia"])
            continue
        springs[row], dampers[row] = float(said.attrib["stiffness"]), float(dynamic.attrib["damping"])
        u[row, own.index(name.removesuffix("_gear"))] = 1.0
        if said.attrib["elastic"] == "gear":
            axis = robot.axis_names.index(name.removesuffix("_gear"))
            u[row, :n] = -robot.drives.gear[axis]
    angle = np.random.default_rng(n).normal(size=n)
    # without gravity nothing is deflected: every free arm joint stands at the motors' angle through the gear
    z = np.zeros(len(own))
    z[:n] = robot.motor_angle(angle)
    for axis, name in enumerate(robot.axis_names):
        if name in own:
            z[own.index(name)] = angle[axis]
    mass, _ = mass_and_gravity(model, u @ z)
    expected = robot.second_order(angle[None], np.zeros((1, n)))
    for found, wanted in (
        (u.T @ mass @ u + np.diag(rotors), expected.mass[0]),
        (u.T @ np.diag(springs) @ u, expected.stiffness[0]),
        (u.T @ np.diag(dampers) @ u, expected.damping[0]),
    ):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * abs(wanted).max())


def test_limits_and_friction_of_the_motors_are_at_the_joints() -> None:
    robot = Robot.load("six_axis")
    _, _, joints = read_back(robot_to_urdf(robot), robot.chain.gravity)
    said = {tag: joints["axis_2"].find(tag) for tag in ("limit", "dynamics")}
    numbers = {tag: {k: float(v) for k, v in e.attrib.items()} for tag, e in said.items() if e is not None}
    assert numbers == {
        "limit": {
            "lower": -1.6,
            "upper": 1.7,
            "effort": pytest.approx(36 * 121),
            "velocity": pytest.approx(420 / 121),
        },
        "dynamics": {"damping": pytest.approx(0.0045 * 121**2), "friction": pytest.approx(0.9 * 121)},
    }
    gear = joints["axis_2_gear"].find("dynamics")
    assert gear is not None
    assert float(gear.attrib["damping"]) == 280


def test_axes_without_limits_turn_for_ever_or_slide_far() -> None:
    robot = random_robot(3, 6)
    _, _, joints = read_back(robot_to_urdf(robot), robot.chain.gravity)
    kinds = {name: joint.get("type") for name, joint in joints.items() if name in robot.axis_names}
    assert kinds == {
        "axis_1": "revolute", "axis_2": "continuous", "axis_3": "prismatic",
        "axis_4": "continuous", "axis_5": "revolute", "axis_6": "prismatic",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["one_axis", "six_axis"])
def test_our_own_reader_takes_the_file_elastic_joints_and_all(name: str, tmp_path: Path) -> None:
    robot = Robot.load(name)
    text = robot_to_urdf(robot)
    assert robot_to_urdf(robot) == text
    assert "<!--" not in text
    (tmp_path / "robot.urdf").write_text(text)
    chain = model_from_urdf(tmp_path / "robot.urdf").chain
    assert chain.n_coordinate == robot.chain.n_coordinate + int(robot.mechanism.elastic_gear.sum())
    assert chain.mass.sum() == pytest.approx(robot.chain.mass.sum())


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2 + 1e-7, 3.0])
def test_roll_pitch_and_yaw_give_the_rotation_back_at_every_pitch(pitch: float) -> None:
    rng = np.random.default_rng(5)
    for roll, yaw in rng.uniform(-np.pi, np.pi, (20, 2)):
        rotation = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
        back = Rotation.from_euler("xyz", roll_pitch_yaw(rotation)).as_matrix()
        np.testing.assert_allclose(back, rotation, rtol=0, atol=5e-16 * 4)


def test_a_flexible_link_has_no_urdf() -> None:
    robot = Robot.load("one_axis")
    body = robot.description.bodies[0].model_copy(
        update={"flexible": FlexibleLink(file="a.npz", root=0, tip=1)}
    )
    flexible = Robot(robot.description.model_copy(update={"bodies": (body,)}))
    with pytest.raises(ConfigurationError, match="URDF has no flexible links, joint 'axis_1' carries one"):
        robot_to_urdf(flexible)
