"""What is no mechanism: wrong indices, joint axes, inertias and modes of a chain, refused with the body's name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import MODAL, PRISMATIC, REVOLUTE, spatial_inertia

if TYPE_CHECKING:
    from robid_core.mechanics.chain import Chain

_RIGID_FIELDS = ("axis", "rotation", "translation", "mass", "centre_of_mass", "inertia")
_MODAL_FIELDS = ("slide", "modal_momentum", "modal_mass", "modal_inertia")
_UNIT_TOLERANCE = 1e-6  # of axes and rotations: what a text file with seven digits leaves
_INERTIA_TOLERANCE = 1e-6  # relative, of the largest principal moment


def check_chain(chain: Chain) -> None:
    """Refuse a chain whose numbers describe no mechanism.

    Raises
    ------
    ConfigurationError
        The message names the body and the number.
    """
    if not chain.names:
        raise ConfigurationError("chain: there is no body; give at least one joint with its body")
    if len(set(chain.names)) < len(chain.names):
        twice = next(name for name in chain.names if chain.names.count(name) > 1)
        raise ConfigurationError(f"chain: body '{twice}': the name is used twice; names must differ")
    if not np.isfinite(chain.gravity).all():
        raise ConfigurationError(f"chain: gravity {chain.gravity} is not finite; give three numbers in m/s^2")
    doubtful = ~_sound_bodies(chain)
    for j, name in enumerate(chain.names):
        where = f"chain: body '{name}':"
        if doubtful[j]:
            _check_body(chain, j, where)
        if chain.joint_type[j] == MODAL:
            _check_modal(chain, j, where)
        elif (
            chain.flexible_root[j] != -1
            or any(getattr(chain, f)[j].any() for f in _MODAL_FIELDS)
            or chain.modal_mass[:, j].any()
        ):
            raise ConfigurationError(f"{where} it has modal fields, but is no modal joint; set joint type 2")
    for root in set(chain.flexible_root.tolist()) - {-1}:
        _check_flexible_body(chain, root)


def _sound_bodies(chain: Chain) -> npt.NDArray[np.bool_]:
    """Tell of all bodies at once whether `_check_body` has nothing to say of them, shape (n,).

    A fit makes chains by the thousand; only where something is doubtful it is looked for what.
    """
    n = len(chain.names)
    numbers = [getattr(chain, field).reshape(n, -1) for field in (*_RIGID_FIELDS, *_MODAL_FIELDS)]
    finite = np.isfinite(np.concatenate(numbers, axis=1)).all(axis=1)
    if not finite.all():
        return np.zeros(n, dtype=np.bool_)  # look at each: what follows needs numbers
    parents = (chain.parent >= -1) & (chain.parent < np.arange(n))
    kinds = (chain.joint_type == REVOLUTE) | (chain.joint_type == PRISMATIC) | (chain.joint_type == MODAL)
    length = np.sqrt((chain.axis**2).sum(axis=1))
    axes = (chain.joint_type == MODAL) | (abs(length - 1) <= _UNIT_TOLERANCE)
    turn = chain.rotation
    off = abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    rotations = (off <= _UNIT_TOLERANCE) & (np.linalg.det(turn) >= 0)
    inertia = chain.inertia
    largest = abs(inertia).max(axis=(1, 2))
    masses = (chain.mass > 0) | ((chain.mass == 0) & (largest == 0))
    skew = abs(inertia - inertia.transpose(0, 2, 1)).max(axis=(1, 2))
    moments = np.linalg.eigvalsh(inertia)
    physical = (
        (skew <= _INERTIA_TOLERANCE * largest)
        & (moments[:, 0] >= -_INERTIA_TOLERANCE * moments[:, 2])
        & (moments[:, 0] + moments[:, 1] >= moments[:, 2] * (1 - _INERTIA_TOLERANCE))
    )
    sound: npt.NDArray[np.bool_] = parents & kinds & axes & rotations & masses & physical
    return sound


def _check_body(chain: Chain, j: int, where: str) -> None:
    for field in (*_RIGID_FIELDS, *_MODAL_FIELDS):
        value = getattr(chain, field)[j]
        if not np.isfinite(value).all():
            raise ConfigurationError(
                f"{where} {field} holds {value[~np.isfinite(value)][0]}; give finite numbers"
            )
    if not -1 <= chain.parent[j] < j:
        raise ConfigurationError(
            f"{where} its parent has index {chain.parent[j]}; a parent stands before, or is -1"
        )
    if chain.joint_type[j] not in (REVOLUTE, PRISMATIC, MODAL):
        raise ConfigurationError(
            f"{where} joint type {chain.joint_type[j]}; 0 is revolute, 1 is prismatic, 2 is modal"
        )
    length = float(np.linalg.norm(chain.axis[j]))
    if chain.joint_type[j] != MODAL and abs(length - 1) > _UNIT_TOLERANCE:
        raise ConfigurationError(f"{where} the joint axis has length {length:.6g}; give a unit vector")
    rotation = chain.rotation[j]
    if abs(rotation @ rotation.T - np.eye(3)).max() > _UNIT_TOLERANCE or np.linalg.det(rotation) < 0:
        raise ConfigurationError(
            f"{where} its rotation is not orthogonal and right-handed; give a rotation matrix"
        )
    mass, inertia = float(chain.mass[j]), chain.inertia[j]
    if mass < 0 or (mass == 0 and inertia.any()):
        raise ConfigurationError(f"{where} mass {mass:.6g} kg; a body with inertia needs a positive mass")
    if abs(inertia - inertia.T).max() > _INERTIA_TOLERANCE * abs(inertia).max():
        raise ConfigurationError(f"{where} its inertia is not symmetric; give a symmetric 3 x 3 matrix")
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    if smallest < -_INERTIA_TOLERANCE * largest:
        raise ConfigurationError(
            f"{where} a principal moment of inertia is {smallest:.6g} kg m^2; none may be negative"
        )
    if smallest + middle < largest * (1 - _INERTIA_TOLERANCE):
        raise ConfigurationError(
            f"{where} principal moments {smallest:.6g}, {middle:.6g}, {largest:.6g} kg m^2: no body has the largest "
            "above the sum of the others; are they about the centre of mass and in the joint frame?"
        )


def _check_modal(chain: Chain, j: int, where: str) -> None:
    root = int(chain.flexible_root[j])
    if not 0 <= root < j or chain.joint_type[root] == MODAL:
        raise ConfigurationError(
            f"{where} the root of its flexible body has index {root}; it is a joint before it that is not modal"
        )
    parent = int(chain.parent[j])
    if parent != root and (chain.joint_type[parent] != MODAL or chain.flexible_root[parent] != root):
        raise ConfigurationError(
            f"{where} it stands on '{chain.names[parent]}'; the modal joints of a flexible body stand in series "
            f"behind its root '{chain.names[root]}', with nothing between"
        )
    if chain.mass[j] != 0:
        raise ConfigurationError(
            f"{where} mass {chain.mass[j]:.6g} kg on a modal joint; the root '{chain.names[root]}' carries the "
            "mass of the whole flexible body"
        )
    strange = np.flatnonzero((chain.modal_mass[j] != 0) & (chain.flexible_root != root))
    if len(strange):
        raise ConfigurationError(
            f"{where} modal mass to '{chain.names[strange[0]]}', which is no mode of the same flexible body"
        )
    if abs(chain.modal_inertia[j] - chain.modal_inertia[j].T).max() > _INERTIA_TOLERANCE * abs(
        chain.modal_inertia[j]
    ).max(initial=0):
        raise ConfigurationError(f"{where} its modal inertia is not symmetric; give a symmetric 3 x 3 matrix")


def _check_flexible_body(chain: Chain, root: int) -> None:
    """Kinetic energy of rigid motion and modes together may not be negative."""
    where = f"chain: body '{chain.names[root]}':"
    modes = np.flatnonzero(chain.flexible_root == root)
    if len(set(chain.parent[modes].tolist())) < len(modes):
        raise ConfigurationError(f"{where} two of its modes stand on one joint; modal joints stand in series")
    modal = chain.modal_mass[np.ix_(modes, modes)]
    if abs(modal - modal.T).max() > _INERTIA_TOLERANCE * abs(modal).max():
        raise ConfigurationError(f"{where} its modal mass is not symmetric; give a symmetric matrix")
    rigid = spatial_inertia(float(chain.mass[root]), chain.centre_of_mass[root], chain.inertia[root])
    momentum = chain.modal_momentum[modes]
    mass = np.block([[rigid, momentum.T], [momentum, modal]])
    scale = np.sqrt(np.maximum(np.diag(mass), np.finfo(float).tiny))
    smallest = float(np.linalg.eigvalsh(mass / np.outer(scale, scale))[0])
    if smallest < -_INERTIA_TOLERANCE:
        raise ConfigurationError(
            f"{where} its modes carry more momentum than its mass allows (smallest eigenvalue of the scaled mass "
            f"matrix {smallest:.3g}); are modal mass and momentum of the same coordinates?"
        )
