"""A chain from a URDF file, read by pinocchio: joints that move, fixed ones merged into the body before.

Placements, axes and inertias come from pinocchio's model, not from the text. What a chain cannot be - mimic,
floating and planar joints, links without mass behind a joint that moves - is refused by name.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio

from robid_core import ConfigurationError
from robid_core.mechanics import PRISMATIC, REVOLUTE, Chain

MOVING = ("revolute", "continuous", "prismatic")


def chain_from_urdf(path: Path) -> Chain:
    """Bodies and joints of a URDF file; joints in pinocchio's order, each body named after its joint.

    Parameters
    ----------
    path
        The URDF file; meshes are not read.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or holds a joint or link that a chain cannot; the message names it.
    """
    try:
        text = path.read_text(encoding="utf-8")
        robot = ElementTree.fromstring(text)
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}; give the path of a URDF file") from None
    except (UnicodeDecodeError, ElementTree.ParseError) as error:
        raise ConfigurationError(f"{path}: not readable as URDF: {error}; is it XML in UTF-8?") from None
    if robot.tag != "robot":
        raise ConfigurationError(
            f"{path}: the file describes a <{robot.tag}>, not a <robot>; give a URDF file"
        )
    _check_joints(path, robot)
    _check_links(path, robot)
    try:
        model = pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise ConfigurationError(
            f"{path}: pinocchio cannot read the file: {reason}; check it with check_urdf"
        ) from None
    return _chain_from_model(model)


def _check_joints(path: Path, robot: ElementTree.Element) -> None:
    joints = robot.findall("joint")
    for joint in joints:
        name, kind = joint.get("name", "?"), joint.get("type", "none")
        if joint.find("mimic") is not None:
            raise ConfigurationError(
                f"{path}: joint '{name}' mimics another; a chain has free joints only: make it fixed, or couple the "
                "axes with the gear matrix of robot.yaml"
            )
        if kind not in (*MOVING, "fixed"):
            raise ConfigurationError(
                f"{path}: joint '{name}' is of type '{kind}'; a chain has revolute, "
                "continuous, prismatic and fixed joints"
            )
    if not any(joint.get("type") in MOVING for joint in joints):
        raise ConfigurationError(
            f"{path}: no joint moves; give at least one revolute, continuous or prismatic joint"
        )


def _check_links(path: Path, robot: ElementTree.Element) -> None:
    """Refuse a joint that moves nothing with a mass: itself and what is fixed to it."""
    masses = {link.get("name"): _mass(path, link) for link in robot.findall("link")}
    fixed: dict[str | None, list[str | None]] = {}
    for joint in robot.findall("joint"):
        if joint.get("type") == "fixed":
            fixed.setdefault(_end(joint, "parent"), []).append(_end(joint, "child"))
    for joint in robot.findall("joint"):
        if joint.get("type") not in MOVING:
            continue
        moved = [_end(joint, "child")]
        for link in moved:
            moved += [child for child in fixed.get(link, []) if child not in moved]
        if not any(masses.get(link, 0.0) > 0 for link in moved):
            raise ConfigurationError(
                f"{path}: link '{moved[0]}' has no inertial with a mass, nor has any link fixed to it; give it an "
                f"<inertial>, joint '{joint.get('name')}' would move nothing"
            )


def _end(joint: ElementTree.Element, which: str) -> str | None:
    end = joint.find(which)
    return None if end is None else end.get("link")


def _mass(path: Path, link: ElementTree.Element) -> float:
    mass = link.find("inertial/mass")
    if mass is None:
        return 0.0
    try:
        return float(mass.get("value", ""))
    except ValueError:
        raise ConfigurationError(
            f"{path}: link '{link.get('name')}': mass '{mass.get('value')}' is not a number; give kg"
        ) from None


def _chain_from_model(model: pinocchio.Model) -> Chain:
    joints = range(1, model.njoints)  # joint 0 is the base
    axes, kinds, zero = [], [], pinocchio.neutral(model)
    for j in joints:
        data = model.joints[j].createData()
        model.joints[j].calc(data, zero)
        motion = np.asarray(data.S).reshape(6)  # linear, angular; the same at every angle
        turns = bool(np.any(motion[3:]))
        axes.append(motion[3:] if turns else motion[:3])
        kinds.append(REVOLUTE if turns else PRISMATIC)
    placements, inertias = [model.jointPlacements[j] for j in joints], [model.inertias[j] for j in joints]
    return Chain(
        parent=np.array([model.parents[j] - 1 for j in joints]),
        joint_type=np.array(kinds),
        axis=np.array(axes),
        rotation=np.array([placement.rotation for placement in placements]),
        translation=np.array([placement.translation for placement in placements]),
        mass=np.array([inertia.mass for inertia in inertias]),
        centre_of_mass=np.array([inertia.lever for inertia in inertias]),
        inertia=np.array([inertia.inertia for inertia in inertias]),
        names=tuple(model.names[j] for j in joints),
        gravity=np.array(model.gravity.linear),
    )
