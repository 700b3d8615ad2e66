"""A tree of rigid bodies joined by revolute and prismatic joints, as arrays.

Joint j carries body j. The joint frame stands at `rotation[j]`, `translation[j]` in the frame of the parent's
body; at coordinate q the body has turned by q about `axis[j]` (revolute) or moved by q along it (prismatic).
Mass, centre of mass and inertia (about the centre of mass) are given in axes of the joint frame. An elastic
coordinate (thesis section 2.2: bearings bend across the transmission) is one more revolute joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

REVOLUTE = 0
PRISMATIC = 1

_UNIT_TOLERANCE = 1e-6  # of axes and rotations: what a text file with seven digits leaves
_INERTIA_TOLERANCE = 1e-6  # relative, of the largest principal moment


@dataclass(frozen=True, eq=False)
class Chain:
    """Bodies and joints; the coordinates are the joints, in order, each parent before its children.

    Raises
    ------
    ConfigurationError
        Where the numbers describe no mechanism; the message names the body and the number.
    """

    parent: IntArray
    """Index of the parent joint, -1 is the base; shape (n,)."""
    joint_type: IntArray
    """REVOLUTE or PRISMATIC; shape (n,)."""
    axis: FloatArray
    """Unit vector in the joint frame; shape (n, 3)."""
    rotation: FloatArray
    """Axes of the joint frame, as columns, in the parent's frame; shape (n, 3, 3)."""
    translation: FloatArray
    """Origin of the joint frame in the parent's frame, m; shape (n, 3)."""
    mass: FloatArray
    """kg; shape (n,)."""
    centre_of_mass: FloatArray
    """m, in the joint frame; shape (n, 3)."""
    inertia: FloatArray
    """kg m^2, about the centre of mass, axes of the joint frame; shape (n, 3, 3)."""
    names: tuple[str, ...]
    """Names of the joints and of the bodies they carry."""
    gravity: FloatArray
    """Acceleration of free fall in the base frame, m/s^2; shape (3,)."""

    def __post_init__(self) -> None:
        n = len(self.names)
        object.__setattr__(self, "names", tuple(self.names))
        for field, shape in _SHAPES.items():
            kind: Any = np.int64 if field in ("parent", "joint_type") else np.float64
            try:
                given = np.array(getattr(self, field), dtype=kind, order="C")
            except (TypeError, ValueError):
                raise ConfigurationError(
                    f"chain: {field} is not an array of numbers; give one row a body"
                ) from None
            expected = tuple(n if size is None else size for size in shape)
            if given.shape != expected:
                raise ConfigurationError(
                    f"chain: {field} has shape {given.shape}, expected {expected} for {n} names; give one row a body"
                )
            object.__setattr__(self, field, given)
        _check(self)

    @property
    def n_coordinate(self) -> int:
        """Number of joints."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the index of a joint or of the body it carries."""
        if name not in self.names:
            raise ConfigurationError(f"chain: no body '{name}'; there are {', '.join(self.names)}")
        return self.names.index(name)

    def with_elastic(self, after: str, name: str, axis: npt.ArrayLike) -> Chain:
        """Insert a revolute coordinate behind a joint; body and children of that joint move behind it.

        Parameters
        ----------
        after
            Joint behind which the body becomes elastic.
        name
            Name of the new coordinate; it now carries the body.
        axis
            Unit vector about which the body bends, in the joint frame of `after`, shape (3,).
        """
        joint = self.index(after)
        if name in self.names:
            raise ConfigurationError(f"chain: body '{name}': an elastic coordinate needs a name of its own")
        new = joint + 1
        moved = np.where(self.parent >= joint, self.parent + 1, self.parent)

        def inserted(field: FloatArray, value: npt.ArrayLike) -> FloatArray:
            return np.insert(field, new, np.asarray(value, dtype=np.float64), axis=0)

        mass = inserted(self.mass, self.mass[joint])
        centre = inserted(self.centre_of_mass, self.centre_of_mass[joint])
        inertia = inserted(self.inertia, self.inertia[joint])
        mass[joint], centre[joint], inertia[joint] = 0.0, 0.0, 0.0
        return Chain(
            parent=np.insert(moved, new, joint),
            joint_type=np.insert(self.joint_type, new, REVOLUTE),
            axis=inserted(self.axis, axis),
            rotation=inserted(self.rotation, np.eye(3)),
            translation=inserted(self.translation, np.zeros(3)),
            mass=mass,
            centre_of_mass=centre,
            inertia=inertia,
            names=(*self.names[:new], name, *self.names[new:]),
            gravity=self.gravity,
        )


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation matrix of a turn by an angle about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned


_SHAPES: dict[str, tuple[int | None, ...]] = {
    "parent": (None,),
    "joint_type": (None,),
    "axis": (None, 3),
    "rotation": (None, 3, 3),
    "translation": (None, 3),
    "mass": (None,),
    "centre_of_mass": (None, 3),
    "inertia": (None, 3, 3),
    "gravity": (3,),
}


def _check(chain: Chain) -> None:
    if not chain.names:
        raise ConfigurationError("chain: there is no body; give at least one joint with its body")
    if len(set(chain.names)) < len(chain.names):
        twice = next(name for name in chain.names if chain.names.count(name) > 1)
        raise ConfigurationError(f"chain: body '{twice}': the name is used twice; names must differ")
    if not np.isfinite(chain.gravity).all():
        raise ConfigurationError(f"chain: gravity {chain.gravity} is not finite; give three numbers in m/s^2")
    for j, name in enumerate(chain.names):
        _check_body(chain, j, f"chain: body '{name}':")


def _check_body(chain: Chain, j: int, where: str) -> None:
    for field in ("axis", "rotation", "translation", "mass", "centre_of_mass", "inertia"):
        value = getattr(chain, field)[j]
        if not np.isfinite(value).all():
            raise ConfigurationError(
                f"{where} {field} holds {value[~np.isfinite(value)][0]}; give finite numbers"
            )
    if not -1 <= chain.parent[j] < j:
        raise ConfigurationError(
            f"{where} its parent has index {chain.parent[j]}; a parent stands before, or is -1"
        )
    if chain.joint_type[j] not in (REVOLUTE, PRISMATIC):
        raise ConfigurationError(f"{where} joint type {chain.joint_type[j]}; 0 is revolute, 1 is prismatic")
    length = float(np.linalg.norm(chain.axis[j]))
    if abs(length - 1) > _UNIT_TOLERANCE:
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
