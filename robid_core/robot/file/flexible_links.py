"""Flexible links of a robot file: finite elements read, reduced, and written out as the modes they come down to.

    bodies:
      - joint: axis_2
        ...                                     # no mass, centre_of_mass, inertia: the matrices have them
        flexible: {file: lower_arm.npz, root: 0, tip: 8, method: craig_bampton, modes: 4, keep: 6}

gets the mass, centre of mass and inertia of the structure, and under `flexible.reduced` its modes. A description is
complete, so the numbers stand in it and not the way to a file: it can be written, sent and hashed alone, and what
was computed from it does not change with the file; of that its SHA-256 is kept.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.robot.file.body import Body, FlexibleLink
from robid_core.robot.file.document import Document
from robid_core.robot.file.part import with_tuples

if TYPE_CHECKING:
    from robid_core.mechanics import Chain
    from robid_core.mechanics.flexible import FlexibleBody


_RIGID = ("mass", "centre_of_mass", "inertia")
_UPPER = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])  # xx yy zz xy xz yz
_MATRIX_MARKET = ("M", "K", "nodes")


def links_written_out(data: dict[str, Any], document: Document, folder: Path) -> dict[str, Any]:
    """Return the data of a robot file with the modes of every flexible link in it.

    Mistakes go to the document: a file that is none, matrices of no link, a mass given besides, a tip that is not near
    the joints behind it.

    Parameters
    ----------
    data
        The file as plain data.
    document
        Takes the mistakes.
    folder
        To which names of files are relative.
    """
    bodies = data.get("bodies")
    if not isinstance(bodies, list):
        return data
    written = [
        _written_out(body, index, bodies, document, folder) if isinstance(body, dict) else body
        for index, body in enumerate(bodies)
    ]
    return {**data, "bodies": written}


def reduced_body(link: FlexibleLink, path: Path) -> tuple[FlexibleBody, float]:
    """Return the body of a link, read, reduced and placed in the joint's frame, and its length from root to tip in m.

    Parameters
    ----------
    link
        What the robot file says.
    path
        Of the matrices.

    Raises
    ------
    ConfigurationError
        As `read_structure` and `flexible_body`.
    """
    from robid_core.mechanics.flexible import flexible_body
    from robid_core.robot.file.finite_elements import read_structure

    structure = read_structure(path, link.units)
    body = flexible_body(structure, link.root, link.tip, link.n_fixed_mode, link.damping_ratio)
    if link.keep is not None:
        body = body.truncated(link.keep)
    turn, length = np.array(link.rotation), float(np.linalg.norm(body.tip))
    return body.placed(turn, turn @ structure.nodes[link.root] + np.array(link.translation)), length


def body_of(body: Body) -> FlexibleBody:
    """Return the flexible body that an entry of `bodies` describes.

    Raises ConfigurationError where the file of its matrices was not read yet.
    """
    from robid_core.mechanics.flexible import FlexibleBody

    link = body.flexible
    if link is None or link.reduced is None:
        raise ConfigurationError(
            f"bodies: joint '{body.joint}': a flexible link without its modes; load the robot from its file"
        )
    modes = link.reduced.modes
    slope = np.zeros((len(modes), 3, 3))
    for k, mode in enumerate(modes):
        slope[k][_UPPER] = slope[k][_UPPER[::-1]] = mode.inertia_slope
    return FlexibleBody(
        mass=body.mass,
        centre_of_mass=np.array(body.centre_of_mass),
        inertia=np.array(body.inertia),
        tip=np.array(link.reduced.tip),
        tip_modes=np.array([[*mode.tip_rotation, *mode.tip_translation] for mode in modes]).T,
        momentum=np.array([[*mode.angular_momentum, *mode.linear_momentum] for mode in modes]).T,
        modal_mass=np.eye(len(modes)),
        modal_stiffness=np.diag([mode.stiffness for mode in modes]),
        modal_damping=np.diag([mode.damping for mode in modes]),
        inertia_slope=slope,
    )


def with_flexible_links(chain: Chain, bodies: tuple[Body, ...], last: dict[str, str]) -> Chain:
    """Chain with the modes of every flexible link behind its joint.

    Parameters
    ----------
    chain
        Of rigid bodies, elastic coordinates inserted.
    bodies
        Of the robot file.
    last
        Name of the coordinate that carries the body of each joint: the joint, or its last elastic coordinate.
    """
    flexible = [body for body in bodies if body.flexible is not None]
    if flexible:
        from robid_core.mechanics.flexible import attach_flexible  # dear to import, and few robots have one

        for body in flexible:
            chain = attach_flexible(chain, last[body.joint], body.joint, body_of(body))
    return chain


def mode_names(bodies: tuple[Body, ...]) -> list[str]:
    """Names of the modal coordinates, in the order of bodies: `axis_2_mode_1`..."""
    reduced = [(body.joint, body.flexible.reduced) for body in bodies if body.flexible is not None]
    return [f"{joint}_mode_{k + 1}" for joint, link in reduced if link for k in range(len(link.modes))]


def _written_out(
    body: dict[str, Any], index: int, bodies: list[Any], document: Document, folder: Path
) -> dict[str, Any]:
    if not isinstance(body.get("flexible"), dict) or body["flexible"].get("reduced") is not None:
        return body
    try:
        link = FlexibleLink.model_validate(with_tuples(body["flexible"]))
    except ValidationError:
        return body  # told with everything else
    place = ("bodies", index, "flexible")
    given = [key for key in _RIGID if body.get(key) is not None]
    for key in given:
        reason = "the matrices of a flexible link have it; leave it out, and put motors that ride on the link into them"
        document.add(("bodies", index, key), reason)
    path = folder / link.file
    try:
        found, length = reduced_body(link, path)
    except ConfigurationError as error:
        document.add((*place, "file"), str(error))
        return body
    far = _far_from_joints(found.tip, length, str(body.get("joint")), bodies)
    if far:
        document.add((*place, "tip"), f"node {link.tip} stands at {far}")
    document.derive((*place, "reduced"), (*place, "file"))
    for key in _RIGID:
        document.derive(("bodies", index, key), (*place, "file"))
    return {
        **body,
        "mass": found.mass,
        "centre_of_mass": found.centre_of_mass.tolist(),
        "inertia": ((found.inertia + found.inertia.T) / 2).tolist(),
        "flexible": {**body["flexible"], "reduced": _as_written(found, _sha256(path))},
    }


def _as_written(body: FlexibleBody, sha256: str) -> dict[str, Any]:
    slope = (body.inertia_slope + body.inertia_slope.transpose(0, 2, 1)) / 2
    modes = [
        {
            "stiffness": float(body.modal_stiffness[k, k]),
            "damping": float(body.modal_damping[k, k]),
            "tip_rotation": body.tip_modes[:3, k].tolist(),
            "tip_translation": body.tip_modes[3:, k].tolist(),
            "angular_momentum": body.momentum[:3, k].tolist(),
            "linear_momentum": body.momentum[3:, k].tolist(),
            "inertia_slope": slope[k][_UPPER].tolist(),
        }
        for k in range(body.n_mode)
    ]
    return {"sha256": sha256, "tip": body.tip.tolist(), "modes": modes}


def _far_from_joints(tip: FloatArray, length: float, joint: str, bodies: list[Any]) -> str:
    """Say so where every joint behind a link is further from its tip than the link is long; else nothing."""
    behind = [b for b in bodies if isinstance(b, dict) and b.get("parent") == joint]
    try:
        ends = np.array([b.get("translation", (0.0, 0.0, 0.0)) for b in behind], dtype=float).reshape(-1, 3)
    except (TypeError, ValueError):
        return ""  # told where it stands
    distance = np.linalg.norm(ends - tip, axis=1)
    if not len(ends) or distance.min() <= length:
        return ""
    nearest = behind[int(np.argmin(distance))].get("joint")
    at = ", ".join(f"{x:.4g}" for x in tip)
    return (
        f"[{at}] m in the frame of joint '{joint}', {distance.min():.3g} m from joint '{nearest}' behind it; is it "
        "that node, and are the file's axes those of the joint's frame (`rotation`, `translation`)?"
    )


def _sha256(path: Path) -> str:
    """Digest of a file; of Matrix Market files, of the three of them in their order."""
    digest = hashlib.sha256()
    stem = path.name.removesuffix("_M.mtx")
    files = [path] if stem == path.name else [path.with_name(f"{stem}_{key}.mtx") for key in _MATRIX_MARKET]
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()
