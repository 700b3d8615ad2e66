"""Data sheets under `axes` written out: springs, bearings across the axis, and the effects that bend the springs.

    axes:
      axis_2:
        gear_ratio: 121
        gear: {data_sheet: {K1_nm_per_rad: 1.3e+5, K2_nm_per_rad: 1.9e+5, K3_nm_per_rad: 2.3e+5, T1: 110, T2: 380}}
        bearing: {moment_rigidity_nm_per_arcmin: 390}

becomes gear: {stiffness, damping}, an effect `transmission.piecewise_linear` labelled axis_2_curve, and two bearings
named after the axis and the directions of its frame across it, axis_2_x and axis_2_z for a joint about y.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter, ValidationError

from robid_core.robot.file.body import Body
from robid_core.robot.file.data_sheet import CURVE, BearingSheet, GearSheet
from robid_core.robot.file.document import Document
from robid_core.robot.file.part import Vector, with_tuples
from robid_core.robot.file.tree import stretched_inertia
from robid_core.robot.file.wording import checked

_BODIES: TypeAdapter[tuple[Body, ...]] = TypeAdapter(tuple[Body, ...])


def sheets_written_out(data: dict[str, Any], document: Document) -> dict[str, Any]:
    """Return the data of a robot file with springs, bearings and effects in place of data sheets.

    Mistakes in a sheet go to the document; its gear is then left out, so that nothing is told twice.
    """
    axes = data.get("axes")
    if not isinstance(axes, dict):
        return data
    written = {**data, "axes": {}}
    for name, axis in axes.items():
        axis = dict(axis) if isinstance(axis, dict) else axis
        written["axes"][name] = axis
        if isinstance(axis, dict) and isinstance(axis.get("gear"), dict) and "data_sheet" in axis["gear"]:
            _gear(str(name), axis, written, document)
        if isinstance(axis, dict) and "bearing" in axis:
            _bearing(str(name), axis, written, document)
    return written


def _gear(name: str, axis: dict[str, Any], written: dict[str, Any], document: Document) -> None:
    gear = axis.pop("gear")
    place = ("axes", name, "gear")
    for key in gear.keys() - {"data_sheet"}:
        document.add((*place, key), "a gear has stiffness and damping, or a data_sheet; keep one of the two")
    sheet = checked(GearSheet, gear["data_sheet"], document, (*place, "data_sheet"))
    body = next((b for b in _bodies(written) if b.joint == (axis.get("joint") or name)), None)
    if body is not None and body.type == "prismatic":
        document.add(
            place,
            f"joint '{body.joint}' is prismatic, the data sheet is of a gear that turns; give stiffness",
        )
        return
    if sheet is None:
        return
    ratio, rotor = axis.get("gear_ratio", 1.0), axis.get("rotor_inertia", 0.0)
    numbers = (
        all(isinstance(value, int | float) and abs(value) < 1e9 for value in (ratio, rotor)) and rotor > 0
    )
    damping = sheet.linear_damping(float(rotor) * float(ratio) ** 2 if numbers else 0.0)
    axis["gear"] = {"stiffness": sheet.linear_stiffness, "damping": damping}
    curve = sheet.curve()
    if curve:
        entry = {"use": CURVE, "on": name, "side": "gear", "with": curve}
        label = re.sub(r"\W", "_", f"{name}_curve")
        _add(written, "effects", label if not label[0].isdigit() else f"_{label}", entry, document, place)


def _bearing(name: str, axis: dict[str, Any], written: dict[str, Any], document: Document) -> None:
    place = ("axes", name, "bearing")
    sheet = checked(BearingSheet, axis.pop("bearing"), document, place)
    bodies = _bodies(written)
    joint = axis.get("joint") or name
    body = next((b for b in bodies if b.joint == joint), None)
    if sheet is None or body is None:
        return
    damping = sheet.linear_damping(stretched_inertia(bodies, body.joint))
    for letter, direction in directions_across(body.axis).items():
        spring = {"joint": joint, "axis": direction, "stiffness": sheet.stiffness, "damping": damping}
        _add(written, "bearings", f"{name}_{letter}", spring, document, place)


def _add(
    written: dict[str, Any],
    section: str,
    key: str,
    entry: dict[str, Any],
    document: Document,
    origin: tuple[str, ...],
) -> None:
    """Put an entry into a section; a name that the file has given already is told at the file's entry."""
    given = written.get(section) or {}
    if not isinstance(given, dict):
        return
    if key in given:
        document.add(
            (section, key),
            f"the data sheet of axis '{origin[1]}' (line {document.mark(origin).line}) makes '{key}' too; "
            "take another name, or give the numbers without the sheet",
        )
        return
    document.derive((section, key), origin)
    written[section] = {**given, key: entry}


def _bodies(data: dict[str, Any]) -> tuple[Body, ...]:
    """Return the bodies; none where they have mistakes, which are told elsewhere."""
    try:
        return _BODIES.validate_python(with_tuples(data.get("bodies", ())))
    except ValidationError:
        return ()


def directions_across(axis: Vector) -> dict[str, list[float]]:
    """Return two unit vectors across a joint's axis, each named after the axis of the frame it lies nearest to."""
    along = np.array(axis)
    first = int(np.argmin(np.abs(along) + 1e-9 * np.arange(3)))  # x before y before z where they are alike
    u: npt.NDArray[np.float64] = np.eye(3)[first] - along[first] * along
    u /= np.linalg.norm(u)
    v: npt.NDArray[np.float64] = np.cross(along, u)
    second = max((i for i in range(3) if i != first), key=lambda i: abs(float(v[i])))
    v *= np.sign(v[second])
    return {
        "xyz"[i]: [float(x) + 0.0 for x in w]
        for i, w in sorted(((first, u), (second, v)), key=lambda e: e[0])
    }
