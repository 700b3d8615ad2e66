"""A tree of bodies joined by revolute, prismatic and modal joints, as arrays.

Joint j carries body j. The joint frame stands at `rotation[j]`, `translation[j]` in the frame of the parent's
body; at coordinate q the body has turned by q about `axis[j]` (revolute) or moved by q along it (prismatic).
Mass, centre of mass and inertia (about the centre of mass) are given in axes of the joint frame. An elastic
coordinate (thesis section 2.2: bearings bend across the transmission) is one more revolute joint. A modal joint
is one modal coordinate of a flexible link (thesis section 2.6); `robid_core.mechanics.flexible` makes them.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import ConfigurationError

REVOLUTE = 0
PRISMATIC = 1
MODAL = 2


def _none() -> FloatArray:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class Chain:
    """Bodies and joints; the coordinates are the joints, in order, each parent before its children.

    The joint transform is the same for all kinds: ``translation by sliding_axis q, then rotation exp([turning_axis
    q])``, both in the joint frame. Revolute: (axis, 0). Prismatic: (0, axis). Modal: (axis, slide), of any length.

    A flexible body is one ordinary joint r, its *root*, and modal joints in series behind it. The floating frame is
    the frame of body r, so the root node moves with joint r and nothing else. Body r carries mass, centre of mass and
    inertia of the whole undeformed link; the modal joints have no mass; the frame behind the last of them is the tip,
    to which the next joint is attached. With eta the modal coordinates of r, [w; v] the angular velocity of r and the
    velocity of its origin in its own axes, and [h_k; p_k] the row of `modal_momentum`::

        T = 1/2 m v.v + v.(w x h(eta)) + 1/2 w.J(eta) w + sum_k (v.p_k + w.h_k) eta_k' + 1/2 eta'.modal_mass eta'
        h(eta) = m centre_of_mass + sum_k p_k eta_k,     J(eta) = J_origin + sum_k modal_inertia[k] eta_k

    Terms of second order in the deflection that contain the rigid motion (spin softening, gyroscopic coupling of the
    modes) are left out, and so is geometric stiffening: small where a link turns slowly against its first frequency.
    The first-order terms must stay: with constant h neither gravity nor a steady translation would be conservative.

    Raises
    ------
    ConfigurationError
        Where the numbers describe no mechanism; the message names the body and the number.
    """

    parent: IntArray
    """Index of the parent joint, -1 is the base; shape (n,)."""
    joint_type: IntArray
    """REVOLUTE, PRISMATIC or MODAL; shape (n,)."""
    axis: FloatArray
    """Unit vector in the joint frame; of a modal joint the rotation vector per unit coordinate; shape (n, 3)."""
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
    slide: FloatArray = field(default_factory=_none)
    """Translation per unit coordinate of a modal joint, in the joint frame; else 0; shape (n, 3)."""
    flexible_root: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Index of the root joint of the flexible body a modal joint belongs to; else -1; shape (n,)."""
    modal_momentum: FloatArray = field(default_factory=_none)
    """Momentum of the flexible body per unit rate of the modal coordinate, [angular about the origin of the root
    body's joint frame; linear], in axes of the root body; else 0; shape (n, 6)."""
    modal_mass: FloatArray = field(default_factory=_none)
    """Symmetric, constant; entries only between modal coordinates of one body; shape (n, n)."""
    modal_inertia: FloatArray = field(default_factory=_none)
    """Change of the flexible body's inertia about the root origin per unit modal coordinate, axes of the root body,
    symmetric; else 0; shape (n, 3, 3)."""

    def __post_init__(self) -> None:
        from robid_core.mechanics.chain_check import check_chain

        n = len(self.names)
        object.__setattr__(self, "names", tuple(self.names))
        for name, shape in SHAPES.items():
            kind: Any = np.int64 if name in _INDICES else np.float64
            try:
                given = np.array(getattr(self, name), dtype=kind, order="C")
            except (TypeError, ValueError):
                raise ConfigurationError(
                    f"chain: {name} is not an array of numbers; give one row a body"
                ) from None
            expected = tuple(n if size is None else size for size in shape)
            if (
                name in ABSENT and (given == ABSENT[name]).all()
            ):  # of any size: bodies may be added or taken away
                given = np.full(expected, ABSENT[name], dtype=kind)
            if given.shape != expected:
                raise ConfigurationError(
                    f"chain: {name} has shape {given.shape}, expected {expected} for {n} names; give one row a body"
                )
            object.__setattr__(self, name, given)
        check_chain(self)

    @property
    def n_coordinate(self) -> int:
        """Number of joints."""
        return len(self.names)

    @property
    def turning_axis(self) -> FloatArray:
        """Rotation vector per unit coordinate in the joint frame, 0 where the joint slides, shape (n, 3)."""
        return np.where((self.joint_type == PRISMATIC)[:, None], 0.0, self.axis)

    @property
    def sliding_axis(self) -> FloatArray:
        """Translation per unit coordinate in the joint frame, 0 where the joint turns, shape (n, 3)."""
        return np.where((self.joint_type == PRISMATIC)[:, None], self.axis, self.slide)

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
        from robid_core.mechanics.insertion import insert_elastic

        return insert_elastic(self, after, name, np.asarray(axis, dtype=np.float64))

    def with_bodies(self, mass: FloatArray, centre_of_mass: FloatArray, inertia: FloatArray) -> Chain:
        """Return the chain with other bodies on the same joints; shapes, units and errors as of the fields."""
        from robid_core.mechanics.chain_check import check_chain

        other = copy.copy(self)
        for name, value in (("mass", mass), ("centre_of_mass", centre_of_mass), ("inertia", inertia)):
            object.__setattr__(other, name, value.reshape(getattr(self, name).shape).copy())
        check_chain(other)
        return other


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation matrix of a turn by an angle about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned


def rotation_by(vector: FloatArray) -> FloatArray:
    """Rotation matrix exp([vector]) of a rotation vector in rad, shape (3,)."""
    angle = float(np.linalg.norm(vector))
    return rotation_about(vector / angle, angle) if angle else np.eye(3)


def spatial_inertia(mass: float, centre_of_mass: FloatArray, inertia: FloatArray) -> FloatArray:
    """Momentum [angular about the origin; linear] over velocity [angular; of the origin], shape (6, 6).

    Parameters
    ----------
    mass, centre_of_mass, inertia
        Of a rigid body: kg, m from the origin (3,), kg m^2 about the centre of mass (3, 3).
    """
    x, y, z = mass * centre_of_mass
    moment = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    shifted = inertia - moment @ moment / mass if mass else inertia
    return np.block([[shifted, moment], [-moment, mass * np.eye(3)]])


SHAPES: dict[str, tuple[int | None, ...]] = {  # None: one row a joint
    "parent": (None,),
    "joint_type": (None,),
    "axis": (None, 3),
    "rotation": (None, 3, 3),
    "translation": (None, 3),
    "mass": (None,),
    "centre_of_mass": (None, 3),
    "inertia": (None, 3, 3),
    "gravity": (3,),
    "slide": (None, 3),
    "flexible_root": (None,),
    "modal_momentum": (None, 6),
    "modal_mass": (None, None),
    "modal_inertia": (None, 3, 3),
}
_INDICES = ("parent", "joint_type", "flexible_root")
ABSENT = {"slide": 0, "flexible_root": -1, "modal_momentum": 0, "modal_mass": 0, "modal_inertia": 0}
