"""Meshes that a URDF draws its links with: which file, where at which joint, how large.

A link's visual meshes count, those for collision where it has none. `package://` names are looked for as ROS does, in
ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, and in the folders above the URDF. The mesh files are not read here.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio

from robid_core import MeshShape
from robid_pin.urdf_check import vector_of

PACKAGE, FILE = "package://", "file://"


def shapes_of(root: Element, model: pinocchio.Model, urdf: Path) -> tuple[list[MeshShape], list[str]]:
    """Meshes of all links, and a sentence for each that cannot be drawn.

    Parameters
    ----------
    root
        The document.
    model
        Its model, with locked joints taken out: says to which joint a link belongs.
    urdf
        The file, where relative names begin.
    """
    shapes, remarks = [], []
    for link in root.findall("link"):
        name = link.get("name", "")
        frame = model.frames[model.getFrameId(name, pinocchio.FrameType.BODY)]
        joint = model.names[frame.parentJoint] if frame.parentJoint else None
        for place, mesh in _meshes(link):
            written = mesh.get("filename", "")
            origin, scale = _placement(place.find("origin")), vector_of(mesh.get("scale", "1 1 1"))
            file = mesh_file(written, urdf)
            if origin is None or scale is None:
                remarks.append(
                    f"link '{name}': origin or scale of '{written}' is not three numbers; it is not drawn"
                )
            elif file is None:
                remarks.append(f"link '{name}': '{written}' is not found; {_where(written)}")
            else:
                placed = frame.placement * origin
                shapes.append(
                    MeshShape(joint, placed.rotation, placed.translation, np.array(scale), file, written)
                )
    return shapes, remarks


def _meshes(link: Element) -> list[tuple[Element, Element]]:
    """Each mesh of a link with the element that places it."""
    for kind in ("visual", "collision"):
        found = [(place, mesh) for place in link.findall(kind) for mesh in place.iterfind("geometry/mesh")]
        if found:
            return found
    return []


def _placement(origin: Element | None) -> pinocchio.SE3 | None:
    """The placement that an origin says, None where it has no three numbers."""
    if origin is None:
        return pinocchio.SE3.Identity()
    xyz, rpy = (vector_of(origin.get(key, "0 0 0")) for key in ("xyz", "rpy"))
    if xyz is None or rpy is None:
        return None
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*rpy), np.array(xyz))


def mesh_file(written: str, urdf: Path) -> Path | None:
    """Return the file that a name in a URDF means, None where there is none."""
    for path in _candidates(written, urdf.absolute()):
        try:
            if path.is_file():
                return path
        except OSError:  # a name that no file can have
            return None
    return None


def _candidates(written: str, urdf: Path) -> Iterator[Path]:
    if written.startswith(PACKAGE):
        package, _, inside = written.removeprefix(PACKAGE).partition("/")
        shares = [Path(prefix) / "share" for prefix in _folders("AMENT_PREFIX_PATH")]
        for folder in (*map(Path, _folders("ROS_PACKAGE_PATH")), *shares, *urdf.parents):
            yield folder / package / inside
            if folder.name == package:
                yield folder / inside
    elif written.startswith(FILE):
        yield Path(unquote(written.removeprefix(FILE)))
    else:
        yield urdf.parent / written


def _folders(variable: str) -> list[str]:
    return [folder for folder in os.environ.get(variable, "").split(os.pathsep) if folder]


def _where(written: str) -> str:
    if written.startswith(PACKAGE):
        return "name its package's folder in ROS_PACKAGE_PATH, or put the package above the URDF"
    return "the name begins at the folder of the URDF"
