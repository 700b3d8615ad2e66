"""Chain and limits from a URDF file, read by pinocchio: joints that move, fixed ones merged into the body before.

Placements, axes and inertias come from pinocchio's model, not from the text; the text is checked before
(`urdf_check`), so that what a chain cannot be is refused by name and line. Limits come from the text.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio

from robid_core import ConfigurationError, JointLimits, RobotModel
from robid_core.mechanics import PRISMATIC, REVOLUTE, Chain
from robid_pin.urdf_check import MOVING, check_urdf, number_of
from robid_pin.urdf_shapes import shapes_of

_FREE = 1.0e9  # what robid writes where URDF wants a limit and the robot has none


def model_from_urdf(path: Path, locked: Mapping[str, float] | None = None) -> RobotModel:
    """Bodies, joints and limits of a URDF file; joints in pinocchio's order, each body named after its joint.

    Parameters
    ----------
    path
        The URDF file; of meshes only names and places are read.
    locked
        Joints that stay at a coordinate (rad or m); names that the file does not have are passed over.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or holds joints or links that a chain cannot; one line for each, with its name.
    """
    still = dict(locked or {})
    try:
        text = path.read_bytes().decode("utf-8")
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}; give the path of a URDF file") from None
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not readable as URDF: {error}; is it XML in UTF-8?") from None
    root = check_urdf(text, str(path), still)
    try:
        model = pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise ConfigurationError(
            f"{path}: pinocchio cannot read the file: {reason}; check it with check_urdf"
        ) from None
    try:
        model = _held(model, still)
        chain = chain_from_model(model)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {str(error).removeprefix('chain: ')}") from None
    moving = {str(j.get("name")): j for j in root.findall("joint") if j.get("type") in MOVING}
    limits = {name: _limits(moving[name]) for name in chain.names}
    springs = {name: spring for name in chain.names if (spring := _spring(moving[name])) is not None}
    shapes, remarks = shapes_of(root, model, path)
    return RobotModel(chain, tuple(moving), limits, springs, tuple(shapes), tuple(remarks))


def _held(model: pinocchio.Model, locked: Mapping[str, float]) -> pinocchio.Model:
    """The model with some joints held at a coordinate: what they carry goes to the body before."""
    numbers = {name: model.getJointId(name) for name in locked if model.existJointName(name)}
    if not numbers:
        return model
    step = np.zeros(model.nv)
    for name, number in numbers.items():
        step[model.joints[number].idx_v] = locked[name]
    place = pinocchio.integrate(model, pinocchio.neutral(model), step)
    return pinocchio.buildReducedModel(model, list(numbers.values()), place)


def _spring(joint: Element) -> tuple[float, float] | None:
    """Stiffness and damping of a joint that robid wrote as elastic."""
    said, dynamic = joint.find("robid[@elastic]"), joint.find("dynamics")
    stiffness = None if said is None else number_of(said.get("stiffness", ""))
    damping = None if dynamic is None else number_of(dynamic.get("damping", "0"))
    return None if not stiffness or stiffness < 0 else (stiffness, max(damping or 0.0, 0.0))


def _limits(joint: Element) -> JointLimits:
    """Limits of a joint; zero or nothing where URDF wants a number is no limit, nor is a range without width."""
    limit = joint.find("limit")
    if limit is None:
        return JointLimits()
    lower, upper, speed, effort = (
        number_of(limit.get(key, "0")) or 0.0 for key in ("lower", "upper", "velocity", "effort")
    )
    bounded = joint.get("type") != "continuous" and lower < upper and max(-lower, upper) < _FREE
    return JointLimits(
        (lower, upper) if bounded else None,
        speed if 0 < speed < _FREE else None,
        effort if 0 < effort < _FREE else None,
    )


def chain_from_model(model: pinocchio.Model) -> Chain:
    """The arrays of a pinocchio model whose joints all have one degree of freedom."""
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
