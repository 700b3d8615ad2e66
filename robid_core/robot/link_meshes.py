"""Triangles of the links, from the mesh files that a robot's model file (URDF) names: what a page draws.

They are read when they are drawn, from where the robot file lies: neither the description nor its hash knows of them.
Each mesh file is read apart (`robid_core/foreign`) by the reader that is registered for its suffix in `robid.meshes`, a
function that takes the path and gives vertices and triangles. Nothing that is wrong with a mesh is an error here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import DataRejected, RobidError
from robid_core.foreign.process import read_apart
from robid_core.registry import MESHES, registry
from robid_core.robot.file.model_file import read_model
from robid_core.robot.file.reading import model_of

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot


@dataclass(frozen=True)
class LinkMesh:
    """A mesh that moves with a joint."""

    joint: str | None
    """Joint of the model file; null: the base."""
    vertices: FloatArray
    """In the joint's frame, m, shape (n_vertex, 3)."""
    triangles: IntArray
    """Vertices of each triangle, shape (n_triangle, 3)."""
    name: str
    """As the model file names it."""


def link_meshes(robot: Robot) -> tuple[list[LinkMesh], list[str]]:
    """Return the meshes of a robot whose file has a `model`, and a sentence for each that cannot be read.

    >>> import robid_core as robid
    >>> robid.link_meshes(robid.Robot.load("six_axis"))  # its file has bodies of its own, and no `model`
    ([], [])
    """
    if robot.file is None:
        return [], []
    try:
        source = model_of(robot.file)
        model = read_model(*source) if source is not None else None
    except RobidError as error:
        return [], [f"no mesh is drawn: {line}" for line in str(error).splitlines()]
    if model is None:
        return [], []
    found, remarks = [], list(model.remarks)
    read: dict[Path, tuple[FloatArray, IntArray] | str] = {}
    for shape in model.shapes:
        if shape.file not in read:
            read[shape.file] = _read(shape.file)
            if isinstance(wrong := read[shape.file], str):
                remarks.append(f"'{shape.name}' is not drawn: {wrong}")
        if not isinstance(mesh := read[shape.file], str):
            placed = (mesh[0] * shape.scale) @ shape.rotation.T + shape.translation
            found.append(LinkMesh(shape.joint, placed, mesh[1], shape.name))
    return found, remarks


def _read(file: Path) -> tuple[FloatArray, IntArray] | str:
    """Return vertices and triangles of a file, or what is wrong with it."""
    try:
        plugin = registry().find(MESHES, file.suffix.lstrip(".").lower())
        plugin.load()  # says what is not installed
        vertices, triangles = read_apart(file, plugin.target, "", f"{plugin.name} mesh")
    except DataRejected as error:
        return str(error).removeprefix("A04: ").removeprefix(f"{file}: ")
    except RobidError as error:
        return str(error)
    vertices, triangles = np.asarray(vertices), np.asarray(triangles)
    if not len(triangles):
        return "it has no triangles"
    if not np.isfinite(vertices).all() or triangles.min() < 0 or triangles.max() >= len(vertices):
        return "its vertices are not all numbers, or its triangles name vertices that it does not have"
    return vertices, triangles
