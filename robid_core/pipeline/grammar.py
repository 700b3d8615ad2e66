"""The grammar of pipeline.yaml: which keys there are, and what stands under them."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, NonNegativeInt, model_validator

from robid_core.settings_types import is_device_name
from robid_core.stage import Settings
from robid_core.yaml_file.nodes import Node, mapping
from robid_core.yaml_file.problems import KeyPath, Mark, ProblemList, nearest

VERSION = 1
_TABLES = ("drives", "executor", "stages", "with", "inputs")  # keys under which a mapping stands


def _version(value: int) -> int:
    if value != VERSION:
        raise ValueError(f"version {value} of the file format is unknown; write `robid: {VERSION}`")
    return value


def _project_name(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}", text) or is_device_name(text):
        raise ValueError(
            f"'{text}' is no name: begin with a letter or digit, then letters, digits, ' ._-', 64 at most"
        )
    return text


def _stage_name(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,63}", text) or is_device_name(text):
        raise ValueError(
            f"'{text}' cannot name a stage: it becomes a file name; use letters, digits and '_', a letter first, 64 "
            "characters at most"
        )
    return text


class RobotUse(Settings):
    """The nominal model of the robot, which the stages start from."""

    model: str
    """A packaged robot (six_axis, one_axis), or the path of a robot.yaml beside the pipeline file."""
    dynamics: str = "kernel"
    """What computes batches of dynamics: numpy, torch, or another plugin of robid.dynamics."""

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"model": value} if isinstance(value, str) else value


class PluginUse(Settings):
    """A plugin and its settings."""

    use: str
    """Name of the plugin; `robid stages` lists them."""
    with_: dict[str, Any] = Field(default={}, alias="with")
    """Settings of the plugin."""


def _one_or_many(value: Any) -> Any:
    """Let one stage be written without brackets."""
    return value if isinstance(value, list) else [value]


class StageUse(PluginUse):
    """One stage: which plugin, its settings, and its inputs where they are not obvious."""

    inputs: dict[str, Annotated[list[str], BeforeValidator(_one_or_many)]] = {}
    """Parameter: name of the stage whose output it takes. Needed only where two stages make the same type. One that
    takes many takes a list."""


class PipelineFile(Settings):
    """A pipeline: robot, drives and stages, wired by what they make and take."""

    robid: Annotated[int, AfterValidator(_version)]
    """Version of the file format: 1."""
    name: Annotated[str, AfterValidator(_project_name)]
    """Name of the pipeline, shown in reports."""
    seed: NonNegativeInt
    """The only source of chance; each stage gets its own child seed."""
    robot: RobotUse
    """The nominal model: a packaged robot, or the path of a robot.yaml."""
    drives: PluginUse | None = None
    """The way to the motors; needed by stages that move the robot."""
    executor: PluginUse | None = None
    """Where parallel work is done; in process by default."""
    stages: Annotated[
        dict[Annotated[str, AfterValidator(_stage_name)], StageUse], Field(min_length=1, max_length=256)
    ]
    """The stages by name, in any order."""


def mend(root: Node, problems: ProblemList) -> Node:
    """Return the document with misspelt keys of the grammar put right, each told as a problem.

    So what stands under a misspelt key is still checked, and nothing that it would have given is missed.
    """
    root = _mend(root, PipelineFile, (), problems)
    entries = dict(root.entries())
    for key in ("drives", "executor"):
        if key in entries:
            entries[key] = _mend(entries[key], PluginUse, (key,), problems)
    if "stages" in entries:
        stages = entries["stages"]
        mended = {n: _mend(s, StageUse, ("stages", n), problems) for n, s in stages.entries().items()}
        if mended:
            entries["stages"] = mapping(stages.mark, mended, stages.keys)
    return mapping(root.mark, entries, root.keys) if entries else root


def _mend(node: Node, model: type[Settings], path: KeyPath, problems: ProblemList) -> Node:
    known = {info.alias or name: name for name, info in model.model_fields.items()}
    entries: dict[str, Node] = {}
    keys: dict[str, Mark] = {}
    for key, entry in node.entries().items():
        meant = None
        if key not in known:
            meant = nearest(
                key, [other for other in known if other not in node.keys and other not in entries]
            )
        if meant is not None:
            problems.add(node.keys[key], (*path, key), f"unknown key '{key}'; did you mean '{meant}'?")
            if entry.value is None or isinstance(entry.value, dict) != (meant in _TABLES):
                problems.spoiled.add((*path, meant))
        entries[meant or key] = entry
        keys[meant or key] = node.keys[key]
    return mapping(node.mark, entries, keys) if entries else node
