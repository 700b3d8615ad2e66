"""From a robot.yaml to a description: packaged robots, model files, robots based on another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from robid_core.errors import ConfigurationError, RobidError
from robid_core.registry import MODELS, registry
from robid_core.robot.description import RobotDescription, named_parameters, with_values

PACKAGED = Path(__file__).parent.parent / "robots"
# Packaged robots come in pairs: what the maker believes, and what the simulated machine is.
PACKAGED_FILES = {
    "six_axis": "six_axis/robot.yaml",
    "six_axis_true": "six_axis/truth.yaml",
    "one_axis": "one_axis/robot.yaml",
    "one_axis_true": "one_axis/truth.yaml",
}
MAXIMUM_BYTES = 4 * 1024 * 1024


def find_robot(name_or_path: str, folder: Path | None = None) -> Path:
    """Return the file of a packaged robot or of a path (relative to `folder`)."""
    if name_or_path in PACKAGED_FILES:
        return PACKAGED / PACKAGED_FILES[name_or_path]
    path = (folder or Path.cwd()) / name_or_path
    if not path.is_file():
        names = ", ".join(PACKAGED_FILES)
        raise ConfigurationError(f"no robot '{name_or_path}': {path} is no file; packaged robots: {names}")
    return path


def read_description(path: Path) -> RobotDescription:
    """Read a robot file into its canonical description, bodies inline.

    A file has either `bodies`, or `model` (a path read through the `robid.models` plugin of its suffix), or
    `base` (another robot) with `parameters` that differ.
    """
    data = _load(path)
    try:
        if "base" in data:
            return _derived(data, path)
        if "model" in data:
            data["bodies"] = _bodies_from_model(path.parent / str(data.pop("model")))
        return RobotDescription.model_validate_json(_as_json(data))
    except ValidationError as error:
        lines = [f"{path.name}: {_place(item['loc'])}{item['msg']}" for item in error.errors()]
        raise ConfigurationError("\n".join(lines)) from error


def _load(path: Path) -> dict[str, Any]:
    if path.stat().st_size > MAXIMUM_BYTES:
        raise ConfigurationError(f"{path}: larger than {MAXIMUM_BYTES // 2**20} MiB; a robot file is not")
    try:
        data = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path.name}: not UTF-8 at byte {error.start}; save it as UTF-8") from error
    except (YAMLError, RecursionError) as error:
        raise ConfigurationError(f"{path.name}: {' '.join(str(error).split())}") from error
    if not isinstance(data, dict):
        raise ConfigurationError(
            f"{path.name}: a robot file holds keys and values (robid_robot: 1, name: ...)"
        )
    return data


def _derived(data: dict[str, Any], path: Path) -> RobotDescription:
    unknown = set(data) - {"robid_robot", "name", "base", "parameters"}
    if unknown:
        raise ConfigurationError(
            f"{path.name}: a robot with a base takes name and parameters only, not {sorted(unknown)}"
        )
    base = read_description(find_robot(str(data["base"]), path.parent))
    parameters = {str(k): float(v) for k, v in (data.get("parameters") or {}).items()}
    missing = [name for name in parameters if name not in named_parameters(base)]
    if missing:
        raise ConfigurationError(f"{path.name}: parameters: {base.name} has no {', '.join(missing)}")
    return with_values(base, parameters).model_copy(update={"name": str(data.get("name", base.name))})


def _bodies_from_model(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        raise ConfigurationError(f"model: {path} is no file")
    try:
        reader = registry().load(MODELS, path.suffix.lstrip(".").lower())
    except RobidError as error:
        raise ConfigurationError(f"model: {path.name}: {error}") from error
    chain = reader(path)
    names = list(chain.names)
    return [
        {
            "joint": names[j],
            "parent": names[int(chain.parent[j])] if chain.parent[j] >= 0 else None,
            "type": ("revolute", "prismatic")[int(chain.joint_type[j])],
            "axis": chain.axis[j].tolist(),
            "translation": chain.translation[j].tolist(),
            "rotation": chain.rotation[j].tolist(),
            "mass": float(chain.mass[j]),
            "centre_of_mass": chain.centre_of_mass[j].tolist(),
            "inertia": chain.inertia[j].tolist(),
        }
        for j in range(len(names))
    ]


def _as_json(data: dict[str, Any]) -> str:
    import json

    return json.dumps(data, default=lambda value: np.asarray(value).tolist())


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location) + ": " if location else ""
