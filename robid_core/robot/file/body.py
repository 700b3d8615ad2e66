"""Joints and the rigid bodies that they carry, one entry of `bodies` each; what no rigid body can be is refused."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from robid_core.robot.file.axis import Spring
from robid_core.robot.file.part import NonNegative, Number, Part, Positive, Vector, refusal
from robid_core.robot.file.rotation import IDENTITY, UNIT_TOLERANCE, Matrix, Rotation

CLOSED_LOOP = (
    "a closed loop, which robid does not model: bodies form a chain or a tree, every joint has one parent. Cut each "
    "loop at one joint and describe the tree that is left; where light rods only carry a motor's turn to a far "
    "joint (parallelogram), write that as coupling between the axes"
)
_INERTIA_TOLERANCE = 1e-6  # of the largest moment, as in mechanics.chain_check


def _of_unit_length(direction: Vector) -> Vector:
    length = math.hypot(*direction)
    if abs(length - 1) > UNIT_TOLERANCE:
        unit = "" if length == 0 else f", such as {[round(x / length, 9) + 0.0 for x in direction]}"
        raise refusal(f"the direction {list(direction)} has length {length:.6g}; give a unit vector{unit}")
    return direction


def _one_parent(parent: Any) -> Any:
    if isinstance(parent, list | tuple):
        raise refusal(f"{len(parent)} parents ({', '.join(map(str, parent))}) make {CLOSED_LOOP}")
    return parent


def rigid_inertia(rows: Matrix) -> Matrix:
    """Return an inertia about a centre of mass as it is; refuse what no rigid body can have."""
    inertia = np.array(rows)
    if not np.allclose(inertia, inertia.T, rtol=0, atol=_INERTIA_TOLERANCE * np.abs(inertia).max()):
        i, j = np.unravel_index(np.argmax(np.abs(inertia - inertia.T)), (3, 3))
        raise refusal(
            f"the matrix is not symmetric: row {i + 1} has {inertia[i, j]:.6g} where row {j + 1} has "
            f"{inertia[j, i]:.6g}; give a symmetric 3 x 3 matrix"
        )
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    if smallest < -_INERTIA_TOLERANCE * abs(largest):
        raise refusal(f"a principal moment is {smallest:.6g} kg m^2; none may be negative")
    if smallest + middle < largest * (1 - _INERTIA_TOLERANCE):
        raise refusal(
            f"principal moments {smallest:.6g}, {middle:.6g}, {largest:.6g} kg m^2: no body has the largest above "
            "the sum of the others; are they about the centre of mass and in the joint's frame?"
        )
    return rows


Direction = Annotated[Vector, AfterValidator(_of_unit_length)]


def _no_list_of_moments(value: Any) -> Any:
    if isinstance(value, tuple) and value and not any(isinstance(row, tuple) for row in value):
        moments = [entry for entry in value if isinstance(entry, int | float)]
        if len(value) == 3 == len(moments):
            x, y, z = (f"{moment:g}" for moment in moments)
            wanted = f"[[{x}, 0, 0], [0, {y}, 0], [0, 0, {z}]], where these are the moments about x, y and z"
        else:
            wanted = "[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]"
        raise refusal(f"{len(value)} entries, and three rows of a matrix are wanted: {wanted}")
    return value


Inertia = Annotated[Matrix, AfterValidator(rigid_inertia), BeforeValidator(_no_list_of_moments)]


class LinkMode(Part):
    """One mode of a flexible link, of unit modal mass, in axes and about the origin of the joint's frame."""

    stiffness: Positive
    """Square of the angular frequency with the root held and the tip free, 1/s^2."""
    damping: NonNegative
    """Twice damping ratio times angular frequency, 1/s."""
    tip_rotation: Vector
    """Rotation of the tip per unit modal coordinate, rad/(sqrt(kg) m)."""
    tip_translation: Vector
    """Displacement of the tip per unit modal coordinate, 1/sqrt(kg)."""
    angular_momentum: Vector
    """Angular momentum of the link per unit modal rate, sqrt(kg) m."""
    linear_momentum: Vector
    """Linear momentum of the link per unit modal rate, sqrt(kg)."""
    inertia_slope: tuple[Number, Number, Number, Number, Number, Number]
    """Change of the link's inertia (xx, yy, zz, xy, xz, yz) per unit modal coordinate, sqrt(kg) m."""


class ReducedLink(Part):
    """What a finite-element file comes down to; mass, centre of mass and inertia are those of the body."""

    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """Of the file that was read."""
    tip: Vector
    """Where the tip stands in the joint's frame, undeformed, m."""
    modes: Annotated[tuple[LinkMode, ...], Field(min_length=1)]
    """Lowest frequency first."""


class FlexibleLink(Part):
    """A finite-element model in place of the rigid body, reduced to the nodes that joints hold.

    The body's mass, centre of mass and inertia come from the matrices. Nodes stand in the joint's frame, unless
    `rotation` and `translation` say how the file's frame is placed in it.
    """

    file: str
    """Matrices of the finite-element model (.npz, .mat, _M.mtx), relative to the robot file."""
    units: Literal["m_kg_s", "mm_t_s"] = "m_kg_s"
    """Units of the matrices: N, m, kg; or N, mm, tonne."""
    root: Annotated[int, Field(ge=0)]
    """Node fixed to the joint that carries the link."""
    tip: Annotated[int, Field(ge=0)]
    """Node at which the joints behind it stand."""
    method: Literal["craig_bampton", "guyan"] = "craig_bampton"
    """How the model is reduced: Guyan's static condensation, or with fixed-interface modes besides."""
    modes: Annotated[int, Field(ge=0)] | None = None
    """Number of fixed-interface modes kept; by default 4 for craig_bampton and none for guyan."""
    keep: Annotated[int, Field(ge=1)] | None = None
    """Number of the link's own modes kept, lowest first; by default all that the reduction has."""
    damping_ratio: Annotated[float, Field(ge=0, lt=1)] = 0.01
    """Damping ratio of every mode of the link."""
    translation: Vector = (0.0, 0.0, 0.0)
    """Origin of the file's frame in the joint's frame, m."""
    rotation: Rotation = IDENTITY
    """Rows of the rotation matrix from the file's frame to the joint's."""
    reduced: ReducedLink | None = None
    """What the file comes down to, as robid writes it: with it the file is not read; delete it to read it again."""

    @property
    def n_fixed_mode(self) -> int:
        """Number of fixed-interface modes."""
        return (4 if self.method == "craig_bampton" else 0) if self.modes is None else self.modes

    @model_validator(mode="after")
    def _ends_differ(self) -> FlexibleLink:
        if self.root == self.tip:
            raise refusal(f"root and tip are both node {self.tip}; give the nodes at the link's two ends")
        if self.method == "guyan" and self.modes:
            raise refusal(
                f"guyan keeps no modes, {self.modes} are asked for; drop modes, or use craig_bampton"
            )
        return self


class Body(Part):
    """A joint and the rigid body that moves with it."""

    joint: str
    """Name of the joint; coordinates carry it."""
    parent: Annotated[str | None, BeforeValidator(_one_parent)] = None
    """Joint whose body carries this one; null: the base."""
    type: Literal["revolute", "prismatic"] = "revolute"
    """How the joint moves."""
    axis: Direction = (0.0, 0.0, 1.0)
    """Direction of motion in the joint's frame, unit length."""
    translation: Vector = (0.0, 0.0, 0.0)
    """Origin of the joint's frame in the parent's frame, m."""
    rotation: Rotation = IDENTITY
    """Rows of the rotation matrix from the joint's frame to the parent's."""
    mass: NonNegative = 0.0
    """Mass in kg."""
    centre_of_mass: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in the joint's frame, m."""
    inertia: Inertia = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """Inertia about the centre of mass, axes of the joint's frame, kg m^2."""
    elastic: Spring | None = None
    """Spring and damper of a joint that no drive moves, such as a foundation that gives way; null: a drive moves it."""
    flexible: FlexibleLink | None = None
    """Finite elements in place of the rigid body; null: rigid."""
