"""What a result depends on, and the key made of it.

The ingredients of a stage: which code it is (distribution, name, version, and a hash of the sources where
they can change under the same version), its settings, the seed where it draws random numbers, the hashes of
the artifacts it takes, of the robot and the drives where it is lent them (the code of their effects included), and
of the files its settings name or lead to.
A recording made on hardware does not depend on versions: no update makes a robot move again. Time stamps of
files take no part.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robid_core import __version__
from robid_core.artifacts import Truth
from robid_core.drives import Drives
from robid_core.pipeline import Pipeline, StageNode
from robid_core.registry import DYNAMICS, Plugin, registry
from robid_core.robot import Robot
from robid_core.run.folded import folded
from robid_core.run.lent_robot import possible_effects
from robid_core.run.sources import core_hash, sources_hash
from robid_core.stage import Context, ReportStage, Stage
from robid_core.store import canonical_json, failures_named, text_hash

KEY_FORMAT = 1
MANY_FILES = 4  # of which no more are named among the differences

Ingredients = dict[str, Any]
InputHash = str | list[str]  # sha256 of the artifact that a parameter takes, or of each where it takes many


@dataclass(frozen=True)
class Surroundings:
    """What all stages of a run share: the pipeline, its robot and the drives (as settings)."""

    pipeline: Pipeline
    robot: Robot
    warnings: dict[str, tuple[str, ...]] = field(default_factory=dict, compare=False)
    """What stages warned of while they were made, by stage: reports print it."""

    @functools.cached_property
    def robot_hash(self) -> str:
        """sha256 of the robot as text, wherever it was read from."""
        return self.robot.sha256

    @property
    def drives(self) -> Drives | None:
        """The way to the motors, where the pipeline has one."""
        if self.pipeline.drives is None:
            return None
        settings = self.pipeline.drives.settings
        return settings if isinstance(settings, Drives) else None

    def warnings_before(self, node: StageNode) -> tuple[str, ...]:
        """Return what the stages before one warned of, in the order of the file, alike ones as one sentence."""
        before, waiting = set[str](), list(node.feeds)
        while waiting:
            name = waiting.pop()
            if name not in before:
                before.add(name)
                waiting += self.pipeline.stage(name).feeds
        return tuple(
            folded(
                f"stage {stage.name}: {text}"
                for stage in self.pipeline.stages
                if stage.name in before
                for text in self.warnings.get(stage.name, ())
            )
        )

    def moves_hardware(self, stage: Stage) -> bool:
        """Tell whether running this stage moves a machine."""
        drives = self.drives
        return drives is not None and drives.moves_hardware and Drives in stage.lends().values()


def ingredients_of(node: StageNode, inputs: Mapping[str, InputHash], shared: Surroundings) -> Ingredients:
    """Return everything the result of a stage depends on, as plain JSON values.

    Parameters
    ----------
    node
        The stage.
    inputs
        sha256 of what it takes, by parameter of `run`; one that stays away is absent.
    shared
        Robot, drives and seed of the pipeline.
    """
    stage, lent = node.stage, set(node.stage.lends().values())
    hardware = shared.moves_hardware(stage)
    found: Ingredients = {
        "format": KEY_FORMAT,
        "stage": plugin_identity(node.plugin, versioned=not hardware),
        "settings": stage.model_dump(mode="json", by_alias=True),
        "inputs": dict(inputs),
        "files": file_hashes(node, shared.pipeline.data_root),
    }
    if not hardware:
        found["core"] = {"version": __version__, "sources": core_hash()}
    others = [*node.references, *_used(stage)]
    if others:
        found["plugins"] = {p.name: plugin_identity(p, versioned=not hardware) for p in others}
    if Context in lent:
        found["seed"] = f"{child_seed(shared.pipeline.seed, node.name):032x}"
    if Context in lent and isinstance(stage, ReportStage):
        found["told"] = {"run": shared.pipeline.name, "warnings": list(shared.warnings_before(node))}
    if lent & {Robot, Truth}:
        found["robot"] = {"sha256": shared.robot_hash, "dynamics": _dynamics(shared.pipeline, hardware)}
        effects = possible_effects(node, shared.pipeline, shared.robot)
        if effects:
            found["robot"]["effects"] = {p.name: plugin_identity(p, versioned=not hardware) for p in effects}
    if lent & {Drives, Truth} and shared.pipeline.drives is not None:
        choice = shared.pipeline.drives
        found["drives"] = {
            "plugin": plugin_identity(choice.plugin, versioned=not hardware),
            "settings": choice.settings.model_dump(mode="json", by_alias=True),
            "files": {f"{f.setting}: {f.written}": file_hash(f.path) for f in choice.files},
            "plugins": {p.name: plugin_identity(p, versioned=not hardware) for p in _used(choice.settings)},
        }
    return found


def file_hashes(node: StageNode, root: Path) -> dict[str, str]:
    """Return the sha256 of every file that a stage reads, by what names it."""
    named = {f"{f.setting}: {f.written}": file_hash(f.path) for f in node.files}
    return {**named, **_data_hashes(node, root)}


def _data_hashes(node: StageNode, root: Path) -> dict[str, str]:
    """Return the sha256 of the data files that a stage reads beyond those that its settings name, by name."""
    known = {file.path for file in node.files}
    files = [path for path in node.stage.external_files(root) if path not in known]
    return {
        (path.relative_to(root) if path.is_relative_to(root) else path).as_posix(): file_hash(path)
        for path in files
    }


def _dynamics(pipeline: Pipeline, hardware: bool) -> Any:
    """Say what computes batches of dynamics: the core's own by its name, or which plugin."""
    name = pipeline.robot.dynamics
    if name not in registry().names(DYNAMICS):
        return name
    return plugin_identity(registry().find(DYNAMICS, name), versioned=not hardware)


def key_of(ingredients: Ingredients) -> str:
    """Return the key under which a result with these ingredients is stored."""
    return text_hash(canonical_json(ingredients))


def child_seed(seed: int, stage: str) -> int:
    """Return the seed of one stage: 128 bits from the pipeline's seed and the stage's name, by SHA-256.

    Adding or reordering stages changes no other stage's chance.
    """
    return int.from_bytes(hashlib.sha256(f"{seed}\0{stage}".encode()).digest()[:16], "big")


def child_generator(seed: int, stage: str) -> np.random.Generator:
    """Return the generator of one stage."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(child_seed(seed, stage))))


def plugin_identity(plugin: Plugin, versioned: bool = True) -> dict[str, Any]:
    """Say which code a plugin is; without version and sources where the result must outlive both."""
    who = {"name": plugin.name.rpartition(":")[2], "distribution": plugin.distribution}
    if not versioned:
        return who
    module = plugin.target.partition(":")[0]
    return {**who, "version": plugin.version, "sources": sources_hash(module, plugin.distribution)}


def _used(settings: Any) -> list[Plugin]:
    """Return the plugins that settings say they will load, from a method `uses() -> [(group, name)]`."""
    uses = getattr(settings, "uses", None)
    return [registry().find(group, name) for group, name in uses()] if callable(uses) else []


def file_hash(path: Path) -> str:
    """Return the sha256 of a file (of a folder: of all files in it, by name)."""
    with failures_named("read", path):
        if path.is_dir():
            parts = {str(p.relative_to(path)): file_hash(p) for p in sorted(path.rglob("*")) if p.is_file()}
            return text_hash(canonical_json(parts))
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def differences(old: Mapping[str, Any], new: Mapping[str, Any], place: tuple[str, ...] = ()) -> list[str]:
    """Say in words what changed from one set of ingredients to another, one line each."""
    lines = []
    for name in [*old, *(name for name in new if name not in old)]:
        before, after = old.get(name), new.get(name)
        if before == after:
            continue
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            inner = differences(before, after, (*place, name))
            if name == "files" and len(inner) > MANY_FILES:
                inner[MANY_FILES - 1 :] = [
                    f"{len(inner) - MANY_FILES + 1} more files appeared, changed or went away"
                ]
            lines += inner
        else:
            lines.append(_change((*place, name), before, after))
    return lines


def _change(place: tuple[str, ...], before: Any, after: Any) -> str:
    from_to = f"{_short(before)} -> {_short(after)}"
    happened = "appeared" if before is None else "went away" if after is None else "changed"
    match place:
        case ("settings", *keys):
            return f"setting {'.'.join(keys)}: {from_to}"
        case ("drives", "settings", *keys):
            return f"setting {'.'.join(keys)} of the drives: {from_to}"
        case ("core", "version"):
            return f"version of robid: {from_to}"
        case ("told", "run"):
            return f"name of the run, which the page tells: {from_to}"
        case ("told", "warnings"):
            return "warnings of the stages before it, which the page tells, changed"
        case (*_, "inputs" | "files" as noun, name):
            return f"{noun.removesuffix('s')} {name} {happened}"
        case ("core", "sources"):
            return f"sources of robid_core {happened}"
        case ("robot", "effects", name, *_):
            return f"effect {name} of the robot {happened}"
        case (*owner, "sources"):
            return f"sources of the {_owner(owner)} {happened}"
        case ("robot", "dynamics", *_):
            return f"dynamics of the robot: {from_to}"
        case (*owner, "name" | "version" | "distribution" as what):
            return f"{what} of the {_owner(owner)}: {from_to}"
        case _:
            return f"{place[0]} {happened}"


def _owner(place: list[str]) -> str:
    return {"stage": "plugin", "plugins": f"plugin {place[-1]}", "drives": "drives"}.get(place[0], place[0])


def _short(value: Any) -> str:
    text = canonical_json(value)
    return text if len(text) <= 60 else text[:57] + "..."
