"""What each entry of a robot file may say for itself, and the file as a whole may not.

The checks read plain data, so that a file with mistakes in some entries still hears of the contradictions between
the others: entries that are no mapping, and values of another type, are passed over here and told elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from robid_core.robot.file.clock import clock_contradictions
from robid_core.robot.file.tree import tree_contradictions
from robid_core.yaml_file.problems import KeyPath

Contradiction = tuple[KeyPath, str]

_SINGULAR = 1e-9  # smallest over largest singular value of a coupling
_UNIT = 1e-5  # what passes for a unit vector
_DEPENDENT = 1e-3  # sine of the angle below which two axes of rotation are one


def contradictions(data: Mapping[str, Any]) -> Iterator[Contradiction]:
    """Yield the place and the reason of everything in a robot file that contradicts something else in it.

    Parameters
    ----------
    data
        The file as plain data, lists as tuples.
    """
    bodies = [body if isinstance(body, Mapping) else {} for body in _sequence(data.get("bodies"))]
    axes, bearings, effects = (_table(data.get(key)) for key in ("axes", "bearings", "effects"))
    joints = [name if isinstance(name := body.get("joint"), str) else "" for body in bodies]
    yield from tree_contradictions(bodies, joints)
    yield from _drives(axes, bodies, joints)
    yield from _elastic_coordinates(bearings, bodies, joints)
    yield from _places_of_effects(effects, (*axes, *bearings, *joints, "base"))
    yield from _coupling(data.get("coupling"), list(axes))
    yield from clock_contradictions(data.get("sample_time_s", 0.001), data.get("step_s"))


def _table(value: Any) -> dict[str, Mapping[str, Any]]:
    if not isinstance(value, Mapping):
        return {}
    return {str(name): entry if isinstance(entry, Mapping) else {} for name, entry in value.items()}


def _sequence(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else ()


def _drives(
    axes: Mapping[str, Mapping[str, Any]], bodies: list[Mapping[str, Any]], joints: list[str]
) -> Iterator[Contradiction]:
    """Every joint has exactly one drive, or a spring of its own and none; a drive sets a torque or a voltage."""
    moved: dict[str, str] = {}
    elastic = {joint for joint, body in zip(joints, bodies, strict=True) if body.get("elastic") is not None}
    for name, axis in axes.items():
        if axis.get("controller") is not None and axis.get("servo") is not None:
            yield (
                ("axes", name),
                "the drive has a controller and a servo; give `controller` (a cascade that sets torques) or `servo` "
                "(one that sets a voltage)",
            )
        joint = str(axis.get("joint") or name)
        if joint not in joints:
            if joints and all(joints):
                reason = f"there is no joint '{joint}' to move; there are {', '.join(joints)}"
                yield ("axes", name, "joint"), reason
        elif joint in moved:
            yield (
                ("axes", name, "joint"),
                f"joint '{joint}' is moved by axis '{moved[joint]}' already; every joint has exactly one drive",
            )
        elif joint in elastic:
            yield (
                ("axes", name, "joint"),
                f"joint '{joint}' is elastic and axis '{name}' moves it; drop elastic from its body: elasticity "
                "between drive and joint is gear.stiffness of the axis",
            )
        moved.setdefault(joint, name)
    for index, joint in enumerate(joints):
        if joint and axes and joint not in moved and joint not in elastic and joint not in joints[:index]:
            yield (
                ("bodies", index, "joint"),
                f"joint '{joint}' has no drive; give it an entry under axes, or a spring "
                "(elastic: {stiffness, damping}), or join its body to its parent's",
            )


def _elastic_coordinates(
    bearings: Mapping[str, Mapping[str, Any]], bodies: list[Mapping[str, Any]], joints: list[str]
) -> Iterator[Contradiction]:
    """Bearings bend across what moves already: joint and bearings of a place turn about independent axes."""
    turning: dict[str, list[Any]] = {}
    for joint, body in zip(joints, bodies, strict=True):
        fixed = body.get("type", "revolute") == "prismatic"
        turning.setdefault(joint, [] if fixed else [body.get("axis", (0.0, 0.0, 1.0))])
    for name, bearing in bearings.items():
        at = bearing.get("joint")
        if name in joints:
            yield (
                ("bearings", name),
                f"a joint is called '{name}' already; an elastic coordinate needs its own name",
            )
        if not isinstance(at, str):
            continue
        if at not in turning:
            if joints and all(joints):
                reason = f"there is no joint '{at}' to bend; there are {', '.join(joints)}"
                yield ("bearings", name, "joint"), reason
            continue
        directions = [*turning[at], bearing.get("axis")]
        try:
            stacked = np.array(directions, dtype=float).reshape(-1, 3)
        except (TypeError, ValueError):
            continue
        if not all(abs(math.hypot(*row) - 1) < _UNIT for row in stacked):
            continue  # told where it stands
        if len(stacked) > 3 or np.linalg.svd(stacked, compute_uv=False)[-1] < _DEPENDENT:
            yield (
                ("bearings", name, "axis"),
                f"about {stacked[-1].tolist()} joint '{at}' can turn already (joint and bearings so far: "
                f"{stacked[:-1].tolist()}); up to two bearings across a revolute joint, about "
                "independent axes; elasticity along it is gear.stiffness of its axis",
            )
            continue
        turning[at] = directions


def _places_of_effects(
    effects: Mapping[str, Mapping[str, Any]], places: tuple[str, ...]
) -> Iterator[Contradiction]:
    for label, entry in effects.items():
        place = entry.get("on")
        if isinstance(place, str) and place not in places and all(places):
            names = ", ".join(dict.fromkeys(places))
            yield ("effects", label, "on"), f"there is no axis, bearing or body '{place}'; there are {names}"


def _coupling(coupling: Any, axes: list[str]) -> Iterator[Contradiction]:
    n = len(axes)
    rows = _sequence(coupling)
    if not rows or not all(isinstance(row, tuple) for row in rows):
        return
    sizes = [len(row) for row in rows]
    if len(rows) != n or any(size != n for size in sizes):
        told = (
            f"{len(rows)} rows of {min(sizes)} to {max(sizes)}"
            if len(set(sizes)) > 1
            else f"{len(rows)} x {sizes[0]}"
        )
        yield (
            ("coupling",),
            f"coupling is {told}, not {n} x {n} for axes {', '.join(axes)}; give a row for each joint",
        )
        return
    try:
        matrix = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        return
    if not np.isfinite(matrix).all():
        return
    _, singular, right = np.linalg.svd(matrix)
    if singular[-1] <= _SINGULAR * singular[0]:
        share = np.abs(right[-1])
        alike = [name for name, part in zip(axes, share, strict=True) if part > 0.1 * share.max()]
        yield (
            ("coupling",),
            f"coupling is singular (singular values {singular[0]:.3g} to {singular[-1]:.3g}): motors "
            f"{', '.join(alike)} can turn together without moving a joint; every motor must move its own axis",
        )
