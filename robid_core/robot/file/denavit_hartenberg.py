"""Denavit-Hartenberg tables of a robot file, written out as bodies on joints.

    dh:
      convention: classic                       # or modified
      base: {rotation: [[1, 0, 0], [0, -1, 0], [0, 0, -1]]}
      links:
        - {joint: axis_1, d: 0.4, a: 0.05, alpha_deg: 90, mass: 20, centre_of_mass: [-0.02, 0.1, 0],
           inertia: [[0.2, 0, 0], [0, 0.1, 0], [0, 0, 0.2]]}

A row is the way from one link frame to the next: with R a rotation about and T a translation along an axis,

    classic (Spong, Siciliano)    Rz(angle) Tz(length) Tx(a) Rx(alpha)
    modified (Craig)              Rx(alpha) Tx(a) Rz(angle) Tz(length)

angle = offset + q and length = d of a revolute joint, angle = offset and length = d + q of a prismatic one. Row i of a
modified table has the a and alpha that Craig calls a_(i-1) and alpha_(i-1).

A body's frame stands on the axis of its joint. That is the link frame of the modified convention; that of the classic
one is at the far end of the link, and the joint's frame is parallel to it and a further back along its x. Inertias
about the centre of mass are then the table's, and centres of mass are too, but for a along x.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from robid_core.arrays import FloatArray
from robid_core.robot.file.body import Inertia, rigid_inertia
from robid_core.robot.file.document import Document
from robid_core.robot.file.part import NonNegative, Number, Part, Vector, refusal
from robid_core.robot.file.rotation import IDENTITY, Rotation
from robid_core.robot.file.wording import checked
from robid_core.yaml_file.problems import KeyPath

_TURN = 6.4  # rad; beyond, an angle of a table is in degrees
_ROUNDING = 1e-15  # cosines and sines below it are those of quarter turns


class Placement(Part):
    """Where the frame before the first row stands in the base frame."""

    translation: Vector = (0.0, 0.0, 0.0)
    """Its origin in the base frame, m."""
    rotation: Rotation = IDENTITY
    """Rows of the rotation matrix from it to the base frame."""


class LinkRow(Part):
    """One row of the table, and the body in its link frame."""

    joint: str
    """Name of the joint; coordinates carry it."""
    type: Literal["revolute", "prismatic"] = "revolute"
    """How the joint moves: about or along z."""
    d: Number = 0.0
    """Length along z, m; of a prismatic joint at coordinate 0."""
    a: Number = 0.0
    """Length along x, m."""
    alpha: Number | None = None
    """Angle about x, rad; 0 where neither this nor alpha_deg is given."""
    alpha_deg: Number | None = None
    """Angle about x, degrees; in place of alpha."""
    offset: Number | None = None
    """Angle about z, of a revolute joint at coordinate 0, rad; 0 where neither this nor offset_deg is given."""
    offset_deg: Number | None = None
    """Angle about z in degrees; in place of offset."""
    mass: NonNegative = 0.0
    """Mass in kg."""
    centre_of_mass: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in the link frame, m."""
    inertia: Inertia | None = None
    """Inertia about the centre of mass, axes of the link frame, kg m^2."""
    inertia_about_origin: Inertia | None = None
    """Inertia about the origin of the link frame, kg m^2; in place of inertia."""

    @model_validator(mode="after")
    def _each_once(self) -> LinkRow:
        for key in ("alpha", "offset"):
            value = getattr(self, key)
            if value is not None and abs(value) > _TURN:
                raise refusal(
                    f"{key} {value:g} rad is {abs(value) / math.tau:.3g} turns; degrees? Write {key}_deg: {value:g}, "
                    f"or {key}: {math.radians(value):.6g}"
                )
        for key, other in (
            ("alpha", "alpha_deg"),
            ("offset", "offset_deg"),
            ("inertia", "inertia_about_origin"),
        ):
            if getattr(self, key) is not None and getattr(self, other) is not None:
                raise refusal(f"{key} and {other} are both given; keep one of the two")
        if self.inertia_about_origin is not None:
            try:
                rigid_inertia(tuple(tuple(row) for row in self.inertia_about_mass.tolist()))  # type: ignore[arg-type]
            except PydanticCustomError as error:
                less = f"inertia_about_origin less mass and centre of mass: {error.message()}"
                raise refusal(less) from None
        return self

    @property
    def inertia_about_mass(self) -> FloatArray:
        """Inertia about the centre of mass, kg m^2, shape (3, 3) (parallel axes)."""
        if self.inertia_about_origin is None:
            return np.zeros((3, 3)) if self.inertia is None else np.array(self.inertia)
        c = np.array(self.centre_of_mass)
        moved: FloatArray = self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return np.array(self.inertia_about_origin) - moved


class DenavitHartenbergTable(Part):
    """What stands under `dh`: a chain, one row for each joint from the base on."""

    convention: Literal["classic", "modified"]
    """Order of the four steps of a row: classic (Spong, Siciliano) or modified (Craig)."""
    base: Placement = Placement()
    """Where the frame before the first row stands."""
    links: Annotated[tuple[LinkRow, ...], Field(min_length=1)]
    """Rows of the table, from the base on."""

    def bodies(self) -> list[dict[str, Any]]:
        """Return the entries of `bodies` that the table describes."""
        turn, origin = np.array(self.base.rotation), np.array(self.base.translation)
        behind = np.zeros(3)  # link frame before in the frame of its joint
        found, parent = [], None
        for row in self.links:
            about_x = _about_x(_angle(row.alpha, row.alpha_deg))
            about_z = _about_z(_angle(row.offset, row.offset_deg))
            along_x = np.array([row.a, 0.0, 0.0])
            if self.convention == "classic":
                rotation, translation = about_z @ about_x, behind + np.array([0.0, 0.0, row.d])
                axis, behind = about_x[2], along_x
            else:
                rotation, translation = about_x @ about_z, about_x @ np.array([row.a, 0.0, row.d])
                axis = np.array([0.0, 0.0, 1.0])
            body = {
                "joint": row.joint,
                "parent": parent,
                "type": row.type,
                "axis": _plain(axis),
                "translation": _plain(origin + turn @ translation),
                "rotation": _plain(turn @ rotation),
                "mass": row.mass,
                "centre_of_mass": _plain(np.array(row.centre_of_mass) + behind),
                "inertia": _plain(row.inertia_about_mass),
            }
            found.append(body)
            turn, origin, parent = np.eye(3), np.zeros(3), row.joint
        return found


def in_table(table: DenavitHartenbergTable, path: KeyPath, value: float) -> tuple[KeyPath, float]:
    """Return where a number of a description stands in the file of its table, and its value there.

    Lengths and angles of the table are no numbers of a description; its bodies' are, and the rest of the robot's.
    """
    if path[0] != "bodies":
        return path, value
    row = table.links[int(path[1])]
    if table.convention == "classic" and path[2:] == ("centre_of_mass", 0):
        value -= row.a
    return ("dh", "links", *path[1:]), value


def table_written_out(data: dict[str, Any], document: Document) -> dict[str, Any]:
    """Return the data of a robot file with bodies in place of its table.

    Mistakes in the table go to the document; there are no bodies then, and nothing is told of what follows.
    """
    if "dh" not in data:
        return data
    rest = {key: value for key, value in data.items() if key != "dh"}
    if "bodies" in data:
        document.add(("dh",), "bodies and a Denavit-Hartenberg table are given; keep one of the two")
        return rest
    document.derive(("bodies",), ("dh",))
    rows = data["dh"].get("links") if isinstance(data["dh"], dict) else None
    for index, row in enumerate(rows if isinstance(rows, list) else ()):
        if isinstance(row, dict) and isinstance(row.get("joint"), str):
            document.names["dh", "links", index] = f"joint '{row['joint']}'"
    table = checked(DenavitHartenbergTable, data["dh"], document, ("dh",))
    if table is None or _repeated(table, document):
        document.spoil(("bodies",))
        return {**rest, "bodies": []}
    for index, row in enumerate(table.links):
        for key in row.model_fields_set:
            document.derive(("bodies", index, key), ("dh", "links", index, key))
        document.derive(("bodies", index), ("dh", "links", index))
    return {**rest, "bodies": table.bodies()}


def _repeated(table: DenavitHartenbergTable, document: Document) -> bool:
    """Tell every joint that stands twice, and whether one does."""
    joints = [row.joint for row in table.links]
    repeated = [index for index, joint in enumerate(joints) if joint in joints[:index]]
    for index in repeated:
        document.add(("dh", "links", index, "joint"), "stands twice; give every joint its own name")
    return bool(repeated)


def _angle(radians: float | None, degrees: float | None) -> float:
    return math.radians(degrees) if degrees is not None else radians or 0.0


def _about_z(angle: float) -> FloatArray:
    c, s = (0.0 if abs(x) < _ROUNDING else x for x in (math.cos(angle), math.sin(angle)))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _about_x(angle: float) -> FloatArray:
    return np.roll(_about_z(angle), 1, axis=(0, 1))


def _plain(values: FloatArray) -> list[Any]:
    """Return an array as lists, without negative zeros."""
    plain: list[Any] = (values + 0.0).tolist()
    return plain
