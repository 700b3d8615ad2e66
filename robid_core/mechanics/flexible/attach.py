"""A rigid body of a chain made flexible: by modal joints, or by the joints of a beam cut into pieces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import MODAL, Chain
from robid_core.mechanics.flexible.body import FlexibleBody
from robid_core.mechanics.flexible.pseudo_joints import PseudoJoints
from robid_core.mechanics.insertion import insert_series


def attach_flexible(chain: Chain, joint: str, name: str, body: FlexibleBody) -> Chain:
    """Make the body of a joint flexible: it is replaced, and the joint's children move to its tip.

    The children keep their place in the undeformed chain. The new coordinates are `<name>_mode_1`...; their springs and
    dampers are `body.modal_stiffness` and `body.modal_damping` (diagonal), not part of a chain. Mode k becomes joint
    `<name>_mode_<k + 1>`: axis and slide are rows of `tip_modes`, the first stands at the undeformed tip, the others on
    the one before.

    Parameters
    ----------
    chain
        As it is with a rigid body.
    joint
        Revolute or prismatic joint whose frame is the body's root (see `FlexibleBody.placed` for another place).
    name
        Name of the link.
    body
        The link with its modes.

    Raises
    ------
    ConfigurationError
        If the joint is modal or its body flexible already, or the modes do not fit the mass.
    """
    root, n = chain.index(joint), body.n_mode
    if chain.joint_type[root] == MODAL or (chain.flexible_root == root).any():
        raise ConfigurationError(
            f"chain: body '{joint}': it is part of a flexible body already; a flexible body needs a joint of its own"
        )
    names = tuple(f"{name}_mode_{k + 1}" for k in range(n))
    translation = np.zeros((n, 3))
    translation[0] = body.tip
    rigid = _with_body(chain, root, body.mass, body.centre_of_mass, body.inertia, body.tip)
    return insert_series(
        rigid,
        joint,
        names,
        joint_type=MODAL,
        axis=body.tip_modes[:3].T,
        slide=body.tip_modes[3:].T,
        translation=translation,
        flexible_root=root,
        modal_momentum=body.momentum.T,
        modal_mass=body.modal_mass,
        modal_inertia=body.inertia_slope,
    )


def attach_pseudo_joints(chain: Chain, joint: str, name: str, pieces: PseudoJoints) -> Chain:
    """Replace the body of a joint by a beam in pieces; children keep their place in the undeformed chain.

    Parameters
    ----------
    chain, joint
        Joint whose frame is the root of the beam.
    name
        Name of the link; joints become `<name>_<pseudo-joint>`, their springs are `pieces.stiffness`.
    pieces
        The beam in pieces.

    Raises
    ------
    ConfigurationError
        If a piece is so short that its inertia is that of no body: give the beam's sections their inertia.
    """
    last = pieces.translation.sum(axis=0)
    rigid = _with_body(
        chain, chain.index(joint), pieces.root_mass, pieces.root_centre_of_mass, pieces.root_inertia, last
    )
    fields = ("axis", "translation", "mass", "centre_of_mass", "inertia")
    rows: dict[str, Any] = {field: getattr(pieces, field) for field in fields}
    return insert_series(rigid, joint, tuple(f"{name}_{pseudo}" for pseudo in pieces.names), **rows)


def _with_body(
    chain: Chain, joint: int, mass: float, centre: FloatArray, inertia: FloatArray, end: FloatArray
) -> Chain:
    """Chain with another body on a joint, and its children placed relative to `end` of that body."""
    changed = {
        field: getattr(chain, field).copy() for field in ("mass", "centre_of_mass", "inertia", "translation")
    }
    changed["mass"][joint], changed["centre_of_mass"][joint], changed["inertia"][joint] = (
        mass,
        centre,
        inertia,
    )
    changed["translation"][chain.parent == joint] -= end
    return replace(chain, **changed)
