"""MuJoCo's description of a robot of robid.

Joints of bodies without mass (elastic coordinates: the body stands behind the last of them) are hinges of one
body, in their order. Each motor is a hinge of its own on a body fixed to the world: rotors have no gyroscopic
terms in the model (2.2). A gear spring is a fixed tendon ``gear @ motors - joint`` with stiffness and
damping, a bearing's spring that of its hinge. A rigid gear leaves no motor: its rotor is the armature of its
joint, or, where rigid gears are coupled, of a fixed tendon of their joints (MuJoCo 3.3.1 or later).
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from oracles.drives import check_plain, gear_of

from robid_core import Robot

FloatArray = npt.NDArray[np.float64]

WEIGHTLESS = 1e-14  # kg and kg m^2, for a body without mass that branches: MuJoCo wants more than 1e-15


def mjcf(robot: Robot, integrator: str, step: float) -> str:
    """MuJoCo's description of the robot, numbers written to the last digit."""
    check_plain(robot)
    root = ElementTree.Element("mujoco")
    _add(root, "compiler", angle="radian", balanceinertia="false", inertiafromgeom="false")
    gravity = _text(robot.chain.gravity)
    option = _add(root, "option", timestep=_text(step), gravity=gravity, integrator=integrator)
    _add(option, "flag", contact="disable", constraint="disable", autoreset="disable", warmstart="disable")
    world, tendon, actuator = (_add(root, part) for part in ("worldbody", "tendon", "actuator"))
    rigid, gear = rigid_motors(robot), gear_of(robot)
    for a, (name, axis) in enumerate(robot.description.axes.items()):
        motor = f"motor.{name}"
        if axis.gear is None:
            fixed = _add(tendon, "fixed", name=motor)
            if len(rigid[name]) > 1:
                fixed.set("armature", _text(axis.rotor_inertia))
            for joint, coefficient in rigid[name].items():
                _add(fixed, "joint", joint=joint, coef=_text(coefficient))
            _add(actuator, "motor", name=motor, tendon=motor)
            continue
        body = _add(world, "body", name=motor)
        _add(body, "inertial", pos="0 0 0", mass="1", diaginertia=_text([axis.rotor_inertia] * 3))
        _add(body, "joint", name=motor, type="hinge", axis="0 0 1")
        _add(actuator, "motor", name=motor, joint=motor)
        spring = {"stiffness": _text(axis.gear.stiffness), "damping": _text(axis.gear.damping)}
        fixed = _add(tendon, "fixed", name=f"gear.{name}", springlength="0", **spring)
        for other, coefficient in zip(robot.description.axes, gear[a], strict=True):
            if coefficient:
                if robot.description.axes[other].gear is None:
                    raise ValueError(f"{name}: its gear spring hangs on {other}, whose gear is rigid")
                _add(fixed, "joint", joint=f"motor.{other}", coef=_text(coefficient))
        _add(fixed, "joint", joint=axis.joint or name, coef="-1")
    _add_bodies(robot, world, -1)
    for joint, inertia in _reflected_rotors(robot).items():
        element = next(e for e in world.iter("joint") if e.get("name") == joint)
        element.set("armature", _text(inertia))
    return ElementTree.tostring(root, encoding="unicode")


def _add_bodies(robot: Robot, parent: ElementTree.Element, parent_joint: int) -> None:
    """Add the bodies that hang on a joint's body; joints without mass go to the body behind them."""
    chain = robot.chain
    for first in np.flatnonzero(chain.parent == parent_joint):
        joints = [int(first)]
        while chain.mass[joints[-1]] == 0 and np.count_nonzero(chain.parent == joints[-1]) == 1:
            joints.append(int(np.flatnonzero(chain.parent == joints[-1])[0]))
        turns, origins = [np.eye(3)], [np.zeros(3)]
        for j in joints:  # frames at coordinate zero, in the frame of the body above
            origins.append(origins[-1] + turns[-1] @ chain.translation[j])
            turns.append(turns[-1] @ chain.rotation[j])
        last, turn, origin = joints[-1], turns[-1], origins[-1]
        body = _add(
            parent, "body", name=f"body.{chain.names[last]}", pos=_text(origin), quat=_text(_quaternion(turn))
        )
        moments, axes = np.linalg.eigh(chain.inertia[last])
        axes[:, 2] *= np.linalg.det(axes)
        _add(
            body, "inertial",
            pos=_text(chain.centre_of_mass[last]), quat=_text(_quaternion(axes)),
            mass=_text(max(chain.mass[last], WEIGHTLESS)), diaginertia=_text(np.maximum(moments, WEIGHTLESS)),
        )  # fmt: skip
        for j, joint_turn, joint_origin in zip(joints, turns[1:], origins[1:], strict=True):
            bearing = robot.description.bearings.get(chain.names[j])
            spring = (
                {"stiffness": _text(bearing.stiffness), "damping": _text(bearing.damping)} if bearing else {}
            )
            _add(
                body, "joint",
                name=chain.names[j], type="slide" if chain.joint_type[j] else "hinge",
                axis=_text(turn.T @ joint_turn @ chain.axis[j]), pos=_text(turn.T @ (joint_origin - origin)),
                **spring,
            )  # fmt: skip
        _add_bodies(robot, body, last)


def driven_joints(robot: Robot) -> list[str]:
    """Names of the joints that the axes move, in the order of axes."""
    return [axis.joint or name for name, axis in robot.description.axes.items()]


def rigid_motors(robot: Robot) -> dict[str, dict[str, float]]:
    """Motors of rigid gears as linear functions of the joints: {axis: {joint: coefficient}}."""
    axes = list(robot.description.axes.items())
    rigid = [a for a, (_, axis) in enumerate(axes) if axis.gear is None]
    others = [a for a in range(len(axes)) if a not in rigid]
    gear = gear_of(robot)
    if gear[np.ix_(rigid, others)].any():
        raise ValueError(f"{robot.name}: a rigid gear is coupled to an elastic one; MuJoCo has no such joint")
    inverse = np.linalg.inv(gear[np.ix_(rigid, rigid)])
    joints = [driven_joints(robot)[a] for a in rigid]
    found = {}
    for a, row in zip(rigid, inverse, strict=True):
        terms = {joint: float(value) for joint, value in zip(joints, row, strict=True) if value}
        lines = [_lineage(robot, joint) for joint in terms]
        if any(one[-1] not in two and two[-1] not in one for one in lines for two in lines):
            raise ValueError(
                f"{axes[a][0]}: its rigid gear couples branches; MuJoCo has no inertia across them"
            )
        found[axes[a][0]] = terms
    return found


def _reflected_rotors(robot: Robot) -> dict[str, float]:
    """Rotors of rigid gears that move one joint, as inertia at that joint, kg m^2."""
    axes, single = robot.description.axes, {k: v for k, v in rigid_motors(robot).items() if len(v) == 1}
    found: dict[str, float] = {}
    for name, terms in single.items():
        for joint, coefficient in terms.items():
            found[joint] = found.get(joint, 0.0) + axes[name].rotor_inertia * coefficient**2
    return found


def _lineage(robot: Robot, joint: str) -> list[int]:
    line = [robot.chain.index(joint)]
    while robot.chain.parent[line[0]] >= 0:
        line.insert(0, int(robot.chain.parent[line[0]]))
    return line


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _text(values: npt.ArrayLike) -> str:
    return " ".join(repr(float(value)) for value in np.atleast_1d(np.asarray(values, dtype=float)))


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Scalar first, of a rotation matrix; the largest component is found from the diagonal."""
    xx, yy, zz = np.diag(rotation)
    size = np.array([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz])
    skew = rotation - rotation.T
    odd = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    even = rotation + rotation.T
    products = np.block([[size[:1], odd], [odd[:, None], even - np.diag(np.diag(even)) + np.diag(size[1:])]])
    row = products[int(np.argmax(size))]
    return np.asarray(row / np.linalg.norm(row))
