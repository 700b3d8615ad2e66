"""Meshes of the links in few triangles, as whole numbers that the page's script draws.

All vertices in one cell of a grid become their mean, and triangles that lose a corner by that go (vertex clustering:
Rossignac and Borrel, 1993). One cell size serves all links: the smallest, in steps of a quarter, that leaves as
few as are turned without delay and as the page has room for.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid_core import FloatArray, IntArray, LinkMesh, Robot
from robid_report.numbers import significant

MOST_TRIANGLES = 6000  # are drawn some tens of times a second
MOST_BYTES = 290_000  # of 300 kB for meshes: the rest is for their frames
NUMBER_BYTES = 7  # of a coordinate, at most -50000 and a comma; of a corner's number too
UNITS = 5000  # of coordinates in the robot's size: the finest cell
OUTSIZE = 10.0  # of the robot's size: a mesh in millimetres is a thousand times too large
COARSER = 1.25
SEVERAL = 3  # remarks of one kind that are told as one

Mesh = tuple[FloatArray, IntArray]


@dataclass(frozen=True)
class DrawnMeshes:
    """What is drawn in place of capsules."""

    joint: list[int]
    """Coordinate of the chain with which each mesh moves; -1: the base."""
    vertices: list[FloatArray]
    """In the joints' frames, m, each (n_vertex, 3)."""
    triangles: list[IntArray]
    """Corners, each (n_triangle, 3)."""
    cell: float
    """Vertices within such a length are one, m."""
    remarks: list[str]
    """What is not drawn."""
    merged: bool
    """Whether that is coarser than what the page can show anyway."""

    def in_words(self) -> str:
        """How links are drawn, for the page."""
        if not self.joint:
            return "Links are drawn as rods of the bodies' masses."
        drawn = (
            f"Links are drawn by the meshes of the model file, in {sum(map(len, self.triangles))} triangles"
        )
        if self.merged:
            drawn += f" (vertices within {significant(1000 * self.cell, 2)} mm are merged)"
        return f"{drawn}; those without a mesh as rods of the bodies' masses."

    def data(self, size: float) -> list[dict[str, Any]]:
        """Return joints, vertices in units of `size` / UNITS, and corners, as plain values."""
        return [
            {
                "joint": joint,
                "vertices": np.round(vertices * UNITS / size).astype(int).ravel().tolist(),
                "triangles": triangles.ravel().tolist(),
            }
            for joint, vertices, triangles in zip(self.joint, self.vertices, self.triangles, strict=True)
        ]


def drawn_meshes(robot: Robot, meshes: list[LinkMesh], remarks: list[str], size: float) -> DrawnMeshes:
    """Reduce meshes, one for each coordinate of the chain that carries some.

    Parameters
    ----------
    robot
        Its chain says with which coordinate the bodies behind a joint move.
    meshes, remarks
        As from `link_meshes`.
    size
        Of the robot, m.
    """
    told, carried = list(remarks), dict[int, list[Mesh]]()
    for mesh in meshes:
        coordinate = _carrier(robot, mesh.joint)
        far = float(np.abs(mesh.vertices).max())
        if coordinate is None:
            told.append(f"'{mesh.name}' is not drawn: the robot has no joint '{mesh.joint}'")
        elif far > OUTSIZE * size:
            told.append(
                f"'{mesh.name}' is not drawn: it lies up to {far:.3g} m from its joint; is its scale right "
                "(0.001 for a file in millimetres)?"
            )
        else:
            carried.setdefault(coordinate, []).append((mesh.vertices, mesh.triangles))
    cell = size / UNITS
    whole = {joint: clustered(_joined(parts), cell) for joint, parts in sorted(carried.items())}
    found = whole
    while _too_many(found.values()):
        cell *= COARSER
        found = {joint: clustered(mesh, cell) for joint, mesh in whole.items()}
    seen = {joint: mesh for joint, mesh in found.items() if len(mesh[1])}
    return DrawnMeshes(
        list(seen),
        [vertices for vertices, _ in seen.values()],
        [triangles for _, triangles in seen.values()],
        cell,
        told,
        merged=found is not whole,
    )


def told_once(remarks: Sequence[str]) -> list[str]:
    """Return remarks of which several that differ in quoted names only are one, with the names of the first.

    >>> told_once([f"link '{name}': 'x/{name}.stl' is not found; look" for name in "abc"])
    ["link 'a': 'x/a.stl' is not found; look (and 2 more of the kind)"]
    """
    groups: dict[str, list[str]] = {}
    for remark in remarks:
        groups.setdefault(re.sub(r"'[^']*\.\w+'|(?<=^link )'[^']*'", "", remark), []).append(remark)
    told = []
    for alike in groups.values():
        several = len(alike) >= SEVERAL
        told += [f"{alike[0]} (and {len(alike) - 1} more of the kind)"] if several else alike
    return told


def _too_many(meshes: Iterable[Mesh]) -> bool:
    n_vertex, n_triangle = np.sum(
        [(len(vertices), len(triangles)) for vertices, triangles in meshes] or [(0, 0)], axis=0
    )
    return bool(n_triangle > MOST_TRIANGLES or 3 * NUMBER_BYTES * (n_vertex + n_triangle) > MOST_BYTES)


def clustered(mesh: Mesh, cell: float) -> Mesh:
    """Vertices of a mesh merged within cells of a grid, and the triangles that are left."""
    vertices, triangles = mesh
    place = np.rint(vertices / cell).astype(np.int64)  # coordinates of zero amid a cell, not at its edge
    place -= place.min(axis=0)
    extent = place.max(axis=0) + 1
    _, cluster = np.unique(np.ravel_multi_index(tuple(place.T), tuple(extent)), return_inverse=True)
    count = np.bincount(cluster)
    mean: FloatArray = np.stack(
        [np.bincount(cluster, weights=column) / count for column in vertices.T], axis=1
    )
    corners = cluster[triangles]
    ordered = np.sort(corners, axis=1)
    proper = (np.diff(ordered, axis=1) > 0).all(axis=1)
    corners, ordered = corners[proper], ordered[proper]
    _, pair = np.unique(ordered[:, 0] * len(count) + ordered[:, 1], return_inverse=True)
    _, first = np.unique(pair * len(count) + ordered[:, 2], return_index=True)
    used, renumbered = np.unique(corners[np.sort(first)], return_inverse=True)
    return mean[used], renumbered.astype(np.int64).reshape(-1, 3)


def _joined(parts: list[Mesh]) -> Mesh:
    before = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    return (
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([triangles + start for (_, triangles), start in zip(parts, before, strict=False)]),
    )


def _carrier(robot: Robot, joint: str | None) -> int | None:
    """Coordinate with which bodies behind a joint move: behind its bearings too; -1 the base, None no such joint."""
    if joint is None:
        return -1
    if joint not in robot.chain.names:
        return None
    behind = [name for name, bearing in robot.structure.bearings.items() if bearing.joint == joint]
    return robot.chain.index([joint, *behind][-1])
