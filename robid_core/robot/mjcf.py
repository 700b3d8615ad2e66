"""A robot written as MJCF, the description of the simulator MuJoCo.

Every axis is a joint that follows its motor through the gear, u = r_g q_m: it has the rotor's inertia as armature, and
viscous and Coulomb friction of the motor as damping and frictionloss, all brought to the joint's side. Where the gear
is elastic, a second joint about the same axis stands behind it, a spring of the gear's deflection; bearings and elastic
joints are springs of their own. Joints in front of a body without mass belong to the body behind them. The
actuator of an axis takes the torque of its motor (`gear` is the ratio). Where gears are coupled, a motor is a fixed
tendon of the joints that it turns: its length is the motor's angle (MuJoCo 3.3.1 or newer for its armature).

At rest MuJoCo's linear model is the robot's own without Coulomb friction (`Robot.second_order`): frictionloss is a
constraint, which <flag frictionloss="disable"/> takes out. Effects and constant friction torques are not written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

_KINDS = ("hinge", "slide")  # as numbered in mechanics.chain
_LEAST = 1e-14  # kg, kg m^2; MuJoCo wants more than 1e-15 of a body that moves


def robot_to_mjcf(robot: Robot) -> str:
    """Return the robot as the text of an MJCF file.

    Raises ConfigurationError for flexible links, and for motors whose coupled gears reach into different branches:
    MuJoCo has neither.
    """
    flexible = [body.joint for body in robot.description.bodies if body.flexible is not None]
    if flexible:
        raise ConfigurationError(
            f"{robot.name}: MJCF has no such flexible links, joint '{flexible[0]}' carries one; leave `flexible` out"
        )
    root = ElementTree.Element("mujoco", {"model": robot.name})
    _add(root, "compiler", angle="radian", balanceinertia="false", autolimits="true")
    option = {"timestep": _text(robot.step_s), "gravity": _text(robot.chain.gravity)}
    _add(root, "option", **option, integrator="implicitfast")
    world = _add(root, "worldbody")
    joints: dict[str, ElementTree.Element] = {}
    _bodies(robot, world, -1, joints)
    _motors(robot, root, joints)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def gear_joint_name(robot: Robot, joint: str) -> str:
    """Return what the joint of an elastic gear is called."""
    name = f"{joint}_gear"
    while name in robot.chain.names:
        name += "_"
    return name


def _bodies(
    robot: Robot, parent: ElementTree.Element, before: int, joints: dict[str, ElementTree.Element]
) -> None:
    """Write what hangs on a joint of the chain: bodies with all joints between them and the body before."""
    chain = robot.chain
    for first in np.flatnonzero(chain.parent == before):
        series = [int(first)]
        while chain.mass[series[-1]] == 0 and len(next_ := np.flatnonzero(chain.parent == series[-1])) == 1:
            series.append(int(next_[0]))
        rotation, origin = np.eye(3), np.zeros(3)
        frames = []
        for j in series:  # in the frame of the body before, all coordinates zero
            origin = origin + rotation @ chain.translation[j]
            rotation = rotation @ chain.rotation[j]
            frames.append((rotation, origin))
        place = {"pos": _text(origin), "quat": _text(quaternion(rotation))}
        body = _add(parent, "body", name=f"{chain.names[series[-1]]}_link", **place)
        last = series[-1]
        moments = chain.inertia[last] + (_LEAST if not chain.inertia[last].any() else 0.0) * np.eye(3)
        upper = [moments[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        mass = max(float(chain.mass[last]), _LEAST)
        centre = _text(chain.centre_of_mass[last])
        _add(body, "inertial", pos=centre, mass=_text(mass), fullinertia=_text(upper))
        for j, (turned, at) in zip(series, frames, strict=True):
            axis, anchor = rotation.T @ turned @ chain.axis[j], rotation.T @ (at - origin)
            _joints(robot, body, j, {"axis": _text(axis), "pos": _text(anchor)}, joints)
        _bodies(robot, body, last, joints)


def _joints(
    robot: Robot,
    body: ElementTree.Element,
    j: int,
    place: dict[str, str],
    joints: dict[str, ElementTree.Element],
) -> None:
    """Write a joint of the chain: that of a motor and its gear's spring, or that of a spring alone."""
    name, kind = robot.chain.names[j], _KINDS[int(robot.chain.joint_type[j])]
    stiffness, damping = robot.spring_arrays()
    elastic = np.flatnonzero(robot.mechanism.elastic_gear).tolist()
    driven = np.flatnonzero(robot.mechanism.arm == j).tolist()
    if not driven:
        spring = len(elastic) + robot.mechanism.elastic.tolist().index(j)
        _spring(body, name, kind, place, stiffness[spring], damping[spring])
        return
    axis = driven[0]
    joints[name] = _add(body, "joint", name=name, type=kind, **place)
    ends = [robot.drives.lower[axis], robot.drives.upper[axis]]
    if np.isfinite(ends).all():
        joints[name].set("range", _text(ends))
    if axis in elastic:
        spring = elastic.index(axis)
        _spring(body, gear_joint_name(robot, name), kind, place, stiffness[spring], damping[spring])


def _spring(
    body: ElementTree.Element, name: str, kind: str, place: dict[str, str], stiffness: float, damping: float
) -> None:
    values = {"stiffness": _text(stiffness), "damping": _text(damping)}
    _add(body, "joint", name=name, type=kind, **place, **values)


def _motors(robot: Robot, root: ElementTree.Element, joints: dict[str, ElementTree.Element]) -> None:
    """Write rotors, friction and actuators, at a joint or at a tendon of several."""
    drives, driven = robot.drives, [robot.chain.names[j] for j in robot.mechanism.arm]
    ratios = np.linalg.inv(drives.gear)  # motor angle over joint angles
    tendons = ElementTree.Element("tendon")
    actuators = ElementTree.Element("actuator")
    for axis, name in enumerate(robot.axis_names):
        row = ratios[axis]
        turned = {driven[k]: float(row[k]) for k in np.flatnonzero(abs(row) > 1e-12 * abs(row).max())}
        motor = {
            "armature": float(drives.rotor_inertia[axis]),
            "damping": float(drives.viscous[axis]),
            "frictionloss": float(drives.coulomb[axis]),
        }
        limit = robot.drives.torque_limit_or(np.full(robot.n_axis, np.inf))[axis]
        control = {"ctrlrange": _text([-limit, limit])} if np.isfinite(limit) else {}
        if len(turned) == 1:
            (joint, ratio), *_ = turned.items()
            powers = {"armature": ratio**2, "damping": ratio**2, "frictionloss": abs(ratio)}
            for key, value in motor.items():
                joints[joint].set(key, _text(value * powers[key]))
            _add(actuators, "motor", name=name, joint=joint, gear=_text(ratio), **control)
            continue
        _refuse_branches(robot, name, list(turned))
        values = {key: _text(value) for key, value in motor.items()}
        tendon = _add(tendons, "fixed", name=f"{name}_motor", **values)
        for joint, ratio in turned.items():
            _add(tendon, "joint", joint=joint, coef=_text(ratio))
        _add(actuators, "motor", name=name, tendon=f"{name}_motor", **control)
    root.extend([part for part in (tendons, actuators) if len(part)])


def _refuse_branches(robot: Robot, axis: str, joints: list[str]) -> None:
    """A tendon with inertia joins joints of one line."""
    chain = robot.chain
    lines = []
    for joint in joints:
        line = [chain.index(joint)]
        while chain.parent[line[-1]] >= 0:
            line.append(int(chain.parent[line[-1]]))
        lines.append(line)
    longest = max(lines, key=len)
    if any(line[0] not in longest for line in lines):
        raise ConfigurationError(
            f"{robot.name}: the motor of {axis} turns joints of different branches ({', '.join(joints)}); MJCF has no "
            "inertia across branches"
        )


def quaternion(rotation: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Unit quaternion (w, x, y, z) of a rotation matrix, shape (4,).

    The eigenvector of Bar-Itzhack's symmetric matrix (2000) to its largest eigenvalue: accurate at every rotation.
    """
    r = np.asarray(rotation, dtype=float)
    matrix = np.empty((4, 4))
    matrix[0, 0] = np.trace(r)
    matrix[0, 1:] = matrix[1:, 0] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    matrix[1:, 1:] = r + r.T - np.trace(r) * np.eye(3)
    found: npt.NDArray[np.float64] = np.linalg.eigh(matrix)[1][:, -1]
    return found


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _text(values: npt.ArrayLike) -> str:
    return " ".join(repr(float(value) + 0.0) for value in np.atleast_1d(np.asarray(values, dtype=float)))
