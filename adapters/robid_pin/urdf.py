"""A chain from a URDF file, read by pinocchio: joints that move, fixed ones merged into the body before.

Placements, axes and inertias come from pinocchio's model, not from the text; the text is checked before
(`urdf_check`), so that what a chain cannot be is refused by name and line.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio

from robid_core import ConfigurationError
from robid_core.mechanics import PRISMATIC, REVOLUTE, Chain
from robid_pin.urdf_check import check_urdf


def chain_from_urdf(path: Path) -> Chain:
    """Bodies and joints of a URDF file; joints in pinocchio's order, each body named after its joint.

    Parameters
    ----------
    path
        The URDF file; meshes are not read.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or holds joints or links that a chain cannot; one line for each, with its name.
    """
    try:
        text = path.read_bytes().decode("utf-8")
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}; give the path of a URDF file") from None
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not readable as URDF: {error}; is it XML in UTF-8?") from None
    check_urdf(text, str(path))
    try:
        model = pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise ConfigurationError(
            f"{path}: pinocchio cannot read the file: {reason}; check it with check_urdf"
        ) from None
    try:
        return chain_from_model(model)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {str(error).removeprefix('chain: ')}") from None


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
