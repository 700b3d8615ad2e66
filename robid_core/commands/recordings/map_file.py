"""A channel map as a file: settings of `acquisition.recorded`, as `robid records ... --output` writes them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from robid_core.commands.recordings.inspection import is_record
from robid_core.errors import ConfigurationError
from robid_core.yaml_file.kind import CHANNEL_MAP
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import FileProblems, ProblemList

SOURCES = ("path", "pattern", "index")
_STAGE = "acquisition.recorded"
_FIELD = re.compile(r"\{[a-z]+\}")  # of a pattern: stands for a number


def read_map(file: Path) -> list[dict[str, Any]]:
    """Return the settings of every `acquisition.recorded` in a file: under `stages`, of one stage, or bare settings.

    Raises
    ------
    ConfigurationError
        Where there is no such file, it is no YAML, or it says nothing of channels.
    """
    if not file.is_file():
        raise ConfigurationError(f"{file}: there is no such file; {advice('RECORDING')}")
    problems = ProblemList(str(file))
    root = read_nodes(file.read_text(encoding="utf-8"), CHANNEL_MAP, problems)
    if root is None or problems.problems:
        raise FileProblems(problems.problems)
    found = [one for one in _settings(root) if any(key in one for key in ("channels", *SOURCES))]
    if not found:
        raise ConfigurationError(f"{file}: holds no channel map; {advice('RECORDING')}")
    return found


def _settings(root: Node) -> list[dict[str, Any]]:
    plain = root.plain()
    if not isinstance(plain, dict):
        return []
    stages = plain.get("stages", {"": plain} if "use" in plain else None)
    if stages is None:
        return [plain]
    used = [one for one in stages.values() if isinstance(one, dict) and one.get("use") == _STAGE]
    return [dict(one.get("with") or {}) for one in used]


def settings_of_record(
    file: Path, name: str, maps: Sequence[Mapping[str, Any]], map_file: Path | None
) -> dict[str, Any]:
    """Return the settings that read a recording, called `name` below the data root.

    Records of robid need none; else the map that names the file is taken, or the one for files of its kind.

    Raises
    ------
    ConfigurationError
        Where no map is given, or several might be meant.
    """
    if is_record(file):
        return {"path": name}
    if map_file is None:
        raise ConfigurationError(
            f"{file}: needs a channel map, which says in what columns the motors' angles and torques are; "
            f"{advice(str(file))}"
        )
    common = [_common_parts(_source(one), name) for one in maps]
    nearest = [one for one, n_part in zip(maps, common, strict=True) if n_part == max(common) > 0]
    alike = [one for one in maps if PurePosixPath(_source(one)).suffix == PurePosixPath(name).suffix]
    chosen = next((some for some in (nearest, alike, maps) if len(some) == 1), None)
    if chosen is None:
        raise ConfigurationError(
            f"{map_file}: has {len(maps)} channel maps, and none alone fits {file}; name the file as the path of one"
        )
    (one,) = chosen
    return {"path": name} | {key: value for key, value in one.items() if key not in SOURCES}


def settings_of_all(
    root: Path, names: Sequence[str], maps: Sequence[Mapping[str, Any]]
) -> dict[str, Any] | None:
    """Return the settings that read recordings below a root as one record, as a pattern numbers them.

    None where they are not all the files that one map's pattern stands for, where some experiment of a configuration
    is missing, or where motions do not repeat: those of different lengths would be cut to the shortest.
    """
    for one in maps:
        pattern = PurePosixPath(str(one.get("pattern") or ""))
        n_part = len(pattern.parts)
        folders = {PurePosixPath(*PurePosixPath(name).parts[:-n_part]) for name in names} if n_part else set()
        if len(folders) != 1 or not one.get("period_s"):
            continue
        whole = str(folders.pop() / pattern)
        found = [re.fullmatch("([0-9]+)".join(map(re.escape, _FIELD.split(whole))), name) for name in names]
        if not all(found) or len(list(root.glob(_FIELD.sub("[0-9]*", whole)))) != len(names):
            continue
        numbers = zip(*(match.groups() for match in found if match), strict=True)
        if math.prod(len(set(own)) for own in numbers) == len(names):
            return dict(one) | {"pattern": whole}
    return None


def _source(settings: Mapping[str, Any]) -> str:
    return str(next((settings[key] for key in SOURCES if settings.get(key)), ""))


def _common_parts(source: str, name: str) -> int:
    """Return how many parts of a file's name, from its last on, are those of a path, or of a pattern of paths."""
    n_part = 0
    for told, part in zip(
        reversed(PurePosixPath(source).parts), reversed(PurePosixPath(name).parts), strict=False
    ):
        if not re.fullmatch("[0-9]+".join(re.escape(one) for one in _FIELD.split(told)), part):
            break
        n_part += 1
    return n_part


def advice(recordings: str) -> str:
    """Say how a channel map comes about."""
    return (
        f"`robid records {recordings} --output channels.yaml` writes one to be checked, and "
        "`--channels channels.yaml` gives it"
    )
