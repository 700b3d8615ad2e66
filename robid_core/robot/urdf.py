"""A robot written as URDF, elastic joints as joints of their own.

Every axis becomes a joint that follows the motor through the gear (r_g q_m); where the gear is elastic, a second joint
with the same axis stands behind it and turns by the gear's deflection (arm minus motor side). Bearings are joints
across. Links between them have no mass: all of it is in the link behind the last.

URDF has a tag for damping and friction (`dynamics`, here at the joint's side), none for stiffness, gravity or motors:
they stand in <robid> elements, which readers of URDF pass over. The matrices of the rigid bodies are the robot's own
for every program that reads the file; rotor inertias are not in them, a program that simulates it must add them from
<robid>. Friction of coupled axes is written as if each motor drove its own joint; effects are not written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot


BASE = "base"
_KINDS = ("revolute", "prismatic")  # as numbered in mechanics.chain; a flexible link's modes come after
_FREE = 1.0e9  # limits where URDF wants a number and the robot has none


def robot_to_urdf(robot: Robot) -> str:
    """Return the robot as the text of a URDF file.

    Raises ConfigurationError for a robot with flexible links: URDF has none.
    """
    flexible = [body.joint for body in robot.description.bodies if body.flexible is not None]
    if flexible:
        raise ConfigurationError(
            f"{robot.name}: URDF has no flexible links, joint '{flexible[0]}' carries one; leave `flexible` out"
        )
    chain, gears, springs = robot.chain, _gear_joints(robot), _springs(robot)
    root = ElementTree.Element("robot", {"name": robot.name})
    ElementTree.SubElement(root, "robid", {"gravity": _numbers(chain.gravity)})
    ElementTree.SubElement(root, "link", {"name": BASE})
    axes = {int(joint): axis for axis, joint in enumerate(robot.mechanism.arm)}
    for j, name in enumerate(chain.names):
        parent = _link(chain.names[chain.parent[j]]) if chain.parent[j] >= 0 else BASE
        kind = _KINDS[int(chain.joint_type[j])]
        origin = (chain.translation[j], roll_pitch_yaw(chain.rotation[j]))
        if j in axes:
            axis, gear = axes[j], gears.get(j)
            joint = _joint(root, name, kind, parent, _link(gear or name), origin, chain.axis[j])
            _drive(joint, robot, axis)
            if gear:
                ElementTree.SubElement(root, "link", {"name": _link(gear)})
                still = (np.zeros(3), np.zeros(3))
                joint = _joint(root, gear, kind, _link(gear), _link(name), still, chain.axis[j])
                _elastic(joint, "gear", *springs[gear])
        else:
            joint = _joint(root, name, kind, parent, _link(name), origin, chain.axis[j])
            _elastic(joint, "bearing", *springs[name])
        _body(root, name, float(chain.mass[j]), chain.centre_of_mass[j], chain.inertia[j])
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def roll_pitch_yaw(rotation: FloatArray) -> FloatArray:
    """Angles of URDF, R = Rz(yaw) Ry(pitch) Rx(roll), shape (3,), rad; exact to rounding at every pitch.

    Yaw first; roll from what is left when yaw is undone, so that both stay accurate where cos(pitch) is nearly zero.
    """
    r = np.asarray(rotation, dtype=float)
    yaw = np.arctan2(r[1, 0], r[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-r[2, 0], c * r[0, 0] + s * r[1, 0])
    roll = np.arctan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    return np.array([roll, pitch, yaw])


def _gear_joints(robot: Robot) -> dict[int, str]:
    """Names of the joints that elastic gears become, by the joint of the chain that they drive."""
    names: dict[int, str] = {}
    for axis, joint in enumerate(robot.mechanism.arm):
        if robot.mechanism.elastic_gear[axis]:
            name = f"{robot.chain.names[joint]}_gear"
            while name in robot.chain.names:
                name += "_"
            names[int(joint)] = name
    return names


def _springs(robot: Robot) -> dict[str, tuple[float, float]]:
    """Stiffness and damping of every elastic joint, by its name in the file."""
    joints = [*_gear_joints(robot).values(), *(robot.chain.names[j] for j in robot.mechanism.elastic)]
    stiffness, damping = robot.spring_arrays()
    return {n: (float(k), float(d)) for n, k, d in zip(joints, stiffness, damping, strict=True)}


def _joint(
    root: ElementTree.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    origin: tuple[FloatArray, FloatArray],
    axis: FloatArray,
) -> ElementTree.Element:
    joint = ElementTree.SubElement(root, "joint", {"name": name, "type": kind})
    ElementTree.SubElement(joint, "parent", {"link": parent})
    ElementTree.SubElement(joint, "child", {"link": child})
    ElementTree.SubElement(joint, "origin", {"xyz": _numbers(origin[0]), "rpy": _numbers(origin[1])})
    ElementTree.SubElement(joint, "axis", {"xyz": _numbers(axis)})
    return joint


def _drive(joint: ElementTree.Element, robot: Robot, axis: int) -> None:
    """Limits and friction of a motor seen from its joint, and what URDF has no tag for."""
    d = robot.drives
    ratio = float(np.linalg.inv(d.gear)[axis, axis])  # motor turns per turn of its own joint
    if joint.get("type") == "revolute" and not np.isfinite([d.lower[axis], d.upper[axis]]).all():
        joint.set("type", "continuous")
    limit = {
        "lower": max(d.lower[axis], -_FREE),
        "upper": min(d.upper[axis], _FREE),
        "effort": d.torque_limit[axis] * abs(ratio),
        "velocity": d.speed_limit[axis] / abs(ratio),
    }
    friction = {"damping": d.viscous[axis] * ratio**2, "friction": d.coulomb[axis] * abs(ratio)}
    _values(joint, "limit", limit)
    _values(joint, "dynamics", friction)
    motor = {"axis": robot.axis_names[axis], "gear_row": _numbers(d.gear[axis])}
    ElementTree.SubElement(joint, "robid", {**motor, "rotor_inertia": _number(d.rotor_inertia[axis])})


def _elastic(joint: ElementTree.Element, kind: str, stiffness: float, damping: float) -> None:
    """A joint that a spring holds: no motor (effort 0), no limits known."""
    _values(joint, "limit", {"lower": -_FREE, "upper": _FREE, "effort": 0.0, "velocity": _FREE})
    _values(joint, "dynamics", {"damping": damping, "friction": 0.0})
    ElementTree.SubElement(joint, "robid", {"elastic": kind, "stiffness": _number(stiffness)})


def _body(root: ElementTree.Element, name: str, mass: float, centre: FloatArray, inertia: FloatArray) -> None:
    link = ElementTree.SubElement(root, "link", {"name": _link(name)})
    if mass == 0:
        return
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", {"xyz": _numbers(centre), "rpy": "0 0 0"})
    _values(inertial, "mass", {"value": mass})
    upper = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    _values(inertial, "inertia", {key: inertia[place] for key, place in upper.items()})


def _values(parent: ElementTree.Element, tag: str, values: dict[str, Any]) -> None:
    ElementTree.SubElement(parent, tag, {key: _number(value) for key, value in values.items()})


def _link(joint: str) -> str:
    return f"{joint}_link"


def _number(value: Any) -> str:
    return repr(float(value) + 0.0)


def _numbers(values: FloatArray) -> str:
    return " ".join(_number(value) for value in values)
