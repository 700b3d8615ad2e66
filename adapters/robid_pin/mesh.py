"""Triangles of a mesh file (STL, OBJ, DAE), read by coal; a damaged one may crash it, so it is called apart."""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np

from robid_core import DataRejected, FloatArray, IntArray


def triangles_of_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    """Triangles of a mesh file: vertices in its own unit, (n_vertex, 3), and the three of each triangle, (n, 3).

    Raises DataRejected where coal cannot read the file.
    """
    try:
        mesh = coal.MeshLoader(coal.NODE_TYPE.BV_AABB).load(str(path), np.ones(3))
    except ValueError as error:
        raise DataRejected(f"{path}: {_reason(str(error), path)}; export it anew") from None
    corners = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return np.array(mesh.vertices(), dtype=np.float64), np.array(
        [(corner[0], corner[1], corner[2]) for corner in corners], dtype=np.int64
    ).reshape(-1, 3)


def _reason(message: str, path: Path) -> str:
    """What coal says of a file, without its own source, the file's folder and the hint that it gives for each."""
    said = message.partition("message:")[2] or message
    lines = [line.strip() for line in said.replace(str(path), path.name).splitlines()]
    return " ".join(
        line.rstrip(".") for line in lines if line and not line.startswith(("Could not load", "Hint:"))
    )
