"""The tree that the bodies of a robot file make: every joint once, behind its parent, no loops; what a joint carries.

Mistakes are found in plain data, as in `contradictions`: an entry with others is judged by what is right in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from robid_core.robot.file.body import CLOSED_LOOP, Body
from robid_core.yaml_file.problems import KeyPath


def tree_contradictions(bodies: list[Mapping[str, Any]], joints: list[str]) -> Iterator[tuple[KeyPath, str]]:
    """Yield the place and the reason of every mistake in the tree; loops are told by the names of their joints.

    Parameters
    ----------
    bodies
        Entries of `bodies` as plain data.
    joints
        Name of each entry's joint; empty where it has none.
    """
    yield from _masses(bodies)
    parents = {joint: body.get("parent") for joint, body in zip(joints, bodies, strict=True)}
    for index, (joint, body) in enumerate(zip(joints, bodies, strict=True)):
        parent = body.get("parent")
        if joint and joint in joints[:index]:
            first = bodies[joints.index(joint)].get("parent")
            if first == parent:
                yield (
                    ("bodies", index, "joint"),
                    f"joint '{joint}' stands twice; give every joint its own name",
                )
            else:
                both = " and ".join(f"'{name}'" if name else "the base" for name in (first, parent))
                yield (
                    ("bodies", index, "joint"),
                    f"joint '{joint}' stands twice, with parents {both}: {CLOSED_LOOP}",
                )
        elif isinstance(parent, str) and parent not in joints and all(joints):
            hint = ", ".join(joints[:index]) or "none before the first"
            yield ("bodies", index, "parent"), f"there is no joint '{parent}'; joints before this one: {hint}"
        elif isinstance(parent, str) and parent in joints[index:]:
            loop = _loop(joint, parents)
            yield (
                ("bodies", index, "parent"),
                f"{' -> '.join(loop)} is {CLOSED_LOOP}"
                if loop
                else f"'{joint}' stands before its parent '{parent}'; write parents first",
            )


def _masses(bodies: list[Mapping[str, Any]]) -> Iterator[tuple[KeyPath, str]]:
    """A body with inertia has a mass; one whose mass is misspelt is told of that."""
    for index, body in enumerate(bodies):
        moments = np.ravel(np.array(body.get("inertia") or (), dtype=object))
        largest = max((abs(x) for x in moments if isinstance(x, float | int)), default=0.0)
        if largest > 0 and body.get("mass", 0) == 0 and body.keys() <= Body.model_fields.keys():
            reason = f"a body of mass 0 has an inertia of {largest:.6g} kg m^2; give its mass in kg"
            yield ("bodies", index, "inertia"), reason


def _loop(joint: str, parents: Mapping[str, Any]) -> list[str]:
    """Return the joints from a joint through its parents back to itself; empty where they end at the base."""
    found, at = [joint], parents.get(joint)
    while isinstance(at, str) and at in parents and len(found) <= len(parents):
        found.append(at)
        if at == joint:
            return found
        at = parents[at]
    return []


def stretched_inertia(bodies: tuple[Body, ...], joint: str) -> float:
    """Inertia of all that a joint carries, stretched out as far from it as lengths allow, kg m^2.

    An upper bound over all angles of the joints behind it: levers are sums of distances, each body turns about its
    largest principal moment. Strokes of prismatic joints are not in it.
    """
    reach = {joint: 0.0}
    total = 0.0
    for body in bodies:
        if body.joint != joint:
            if body.parent not in reach:
                continue
            reach[body.joint] = reach[body.parent] + float(np.linalg.norm(body.translation))
        lever = reach[body.joint] + float(np.linalg.norm(body.centre_of_mass))
        total += body.mass * lever**2 + float(np.linalg.eigvalsh(np.array(body.inertia))[-1])
    return total
