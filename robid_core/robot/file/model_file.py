"""Bodies from a model file (URDF), through the reader that is registered for its suffix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robid_core.errors import ConfigurationError
from robid_core.registry import MODELS, load_plugin

_KINDS = ("revolute", "prismatic")  # as numbered in mechanics.chain; a flexible link's modes come after


def bodies_from_model(path: Path) -> list[dict[str, Any]]:
    """Return the entries of `bodies` that a model file describes.

    Raises
    ------
    ConfigurationError
        Where there is no such file, or it describes no chain; one line for each mistake.
    PluginError
        Where no reader for its suffix can be imported.
    """
    if not path.is_file():
        raise ConfigurationError(f"{path} is no file; the path is relative to the robot file")
    chain = load_plugin(MODELS, path.suffix.lstrip(".").lower())(path)
    names = list(chain.names)
    modal = [name for name, kind in zip(names, chain.joint_type, strict=True) if kind >= len(_KINDS)]
    if modal:
        raise ConfigurationError(
            f"{path.name}: '{modal[0]}' is a mode of a flexible link; a model file gives rigid bodies, the link is "
            "written as `flexible` under `bodies`"
        )
    return [
        {
            "joint": names[j],
            "parent": names[int(chain.parent[j])] if chain.parent[j] >= 0 else None,
            "type": _KINDS[int(chain.joint_type[j])],
            "axis": chain.axis[j].tolist(),
            "translation": chain.translation[j].tolist(),
            "rotation": chain.rotation[j].tolist(),
            "mass": float(chain.mass[j]),
            "centre_of_mass": chain.centre_of_mass[j].tolist(),
            "inertia": chain.inertia[j].tolist(),
        }
        for j in range(len(names))
    ]
