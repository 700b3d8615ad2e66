"""The manifest: everything from which a run can be made again, and what `--locked` holds it to.

Written after each stage, at once and for good. It has the clock in it; identity to the bit is claimed for
artifacts, not for the manifest. It carries its own hash: one that is damaged is told, set aside by the next run, and in
nobody's way, since what is finished stands in the store.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from robid_core.errors import ConfigurationError, StoreError
from robid_core.pipeline.wiring import Source
from robid_core.run.folder import RunFolder
from robid_core.run.identity import differences
from robid_core.store import Files, NoFile, Store, canonical_json, failures_named, text_hash

MANIFEST_FORMAT = 3  # 1 had no hash of its own, 2 no warnings


class DamagedManifest(StoreError):
    """A manifest that is not what a run wrote; the next run sets it aside."""

    def __init__(self, folder: RunFolder, why: str) -> None:
        self.damage = f"R06: {folder.manifest}: damaged ({why})"
        super().__init__(
            f"{self.damage}; run again: it is set aside and written anew, and finished stages are kept"
        )


@dataclass(frozen=True)
class StageRecord:
    """One stage in the manifest.

    `outcome` is "made", "same" (made again, same bytes), "kept", "refused", or "earlier": the artifact that
    stands in the folder comes from an earlier run, because this one did not get there.
    """

    outcome: str
    key: str = ""
    artifact: str = ""  # class name
    file: str = ""  # relative to the run folder
    sha256: str = ""
    recording: bool = False
    seconds: float = 0.0
    inputs: Mapping[str, Source] = field(default_factory=dict)  # parameter: stage, or stages
    ingredients: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""
    doubts: Sequence[Mapping[str, str]] = ()  # kind, sentence, remedy, degree (older ones: a doubt)
    warnings: Sequence[str] = ()  # what the stage warned of while it was made
    raw: Mapping[str, str] = field(default_factory=dict)  # raw logs, relative to the run folder: their sha256


@dataclass
class Manifest:
    """What a run was made of, and what came out."""

    name: str
    status: str  # "running", "done", "failed", "interrupted"
    pipeline: dict[str, Any]  # file, sha256, overrides
    seed: int
    robot: dict[str, str]  # written, sha256
    environment: dict[str, Any]
    jobs: int
    started: str
    finished: str = ""
    making: str = ""  # the stage that is, or was when the run ended, being made
    ending: str = ""  # why it failed
    stages: dict[str, StageRecord] = field(default_factory=dict)

    def write(self, store: Store, folder: RunFolder) -> None:
        """Write the manifest in place of the one before."""
        store.write_json(folder.manifest, with_hash({"robid_manifest": MANIFEST_FORMAT, **asdict(self)}))

    @classmethod
    def read(cls, folder: RunFolder, files: Files | None = None) -> Manifest | None:
        """Read the manifest of a run; None where there is none.

        Raises
        ------
        DamagedManifest
            If it is not what a run wrote.
        StoreError
            If it cannot be read, or was written by a newer robid.
        """
        with failures_named("read", folder.manifest):
            try:
                data = (files or Files()).read(folder.manifest)
            except FileNotFoundError:
                return None
            except NoFile as error:
                raise DamagedManifest(folder, "a folder, a pipe or a device stands there") from error
        try:
            content = json.loads(data)
            version = _checked_version(folder, content)
            if version > MANIFEST_FORMAT:
                raise StoreError(f"{folder.manifest}: written by a newer robid; update robid to read it")
            stages = {name: StageRecord(**record) for name, record in content.pop("stages").items()}
            return cls(**content, stages=stages)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise DamagedManifest(folder, f"{type(error).__name__}: {error}") from error


def warnings_of(manifest: Manifest | None) -> dict[str, tuple[str, ...]]:
    """Return what the stages of a run warned of, by stage."""
    stages = manifest.stages.items() if manifest is not None else ()
    return {name: tuple(record.warnings) for name, record in stages if record.warnings}


def ending_told(manifest: Manifest) -> str:
    """Return in words how a run ended that nobody saw to its end; empty where it was done."""
    where = f" while stage {manifest.making} was made" if manifest.making else ""
    kept = "what it finished is kept"
    if manifest.status == "running":
        return (
            f"the run before, begun {manifest.started}, was cut off{where}: its process was killed, crashed or ended "
            f"itself; {kept}"
        )
    if manifest.status == "interrupted":
        return f"the run before was interrupted{where}; {kept}"
    return (
        f"the run before failed: {manifest.ending or 'for no reason known'}"
        if manifest.status == "failed"
        else ""
    )


def with_hash(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a manifest with its own hash, in place of the one it has."""
    bare = {name: value for name, value in content.items() if name != "check"}
    return {**bare, "check": text_hash(canonical_json(bare))}


def readable_manifest(folder: RunFolder, files: Files | None = None) -> tuple[Manifest | None, str]:
    """Return the manifest of a run, None where there is none or a damaged one, and what is damaged in words."""
    try:
        return Manifest.read(folder, files), ""
    except DamagedManifest as error:
        return None, error.damage


def refuse_damaged_manifest(damage: str) -> None:
    """Raise StoreError where a run is to be held to a manifest that is damaged (in words; empty: it is not)."""
    if damage:
        raise StoreError(f"{damage}, so there is nothing to hold this run to; run without --locked")


def _checked_version(folder: RunFolder, content: dict[str, Any]) -> int:
    """Take format and hash out of a manifest and return its format; DamagedManifest where the hash does not fit."""
    version = content.get("robid_manifest")
    if type(version) is not int or version < 1:
        raise DamagedManifest(folder, "it states no format")
    if ("check" in content or version > 1) and content.get("check") != with_hash(content)["check"]:
        raise DamagedManifest(folder, "its content does not fit its hash")
    content.pop("check", None)
    del content["robid_manifest"]
    return version


def locked_differences(
    old: Manifest, new: Manifest, ingredients: Mapping[str, Mapping[str, Any]]
) -> list[str]:
    """Return in words what of a run is no longer as its manifest says, one line each.

    Parameters
    ----------
    old
        The manifest of the run that is to be made again.
    new
        What would run now.
    ingredients
        What each stage would be made of now; its inputs are results, and not compared.
    """
    lines = []
    if old.pipeline["sha256"] != new.pipeline["sha256"]:
        lines.append("the pipeline file changed")
    if old.pipeline["overrides"] != new.pipeline["overrides"]:
        lines.append(f"--set: {old.pipeline['overrides']} -> {new.pipeline['overrides']}")
    if old.seed != new.seed:
        lines.append(f"seed: {old.seed} -> {new.seed}")
    if old.robot["sha256"] != new.robot["sha256"]:
        lines.append(f"the robot changed ({old.robot['written']} -> {new.robot['written']})")
    for what, noun in (("versions", ""), ("threads", "threads of ")):
        before, now = old.environment[what], new.environment[what]
        for name in sorted({*before, *now}):
            if before.get(name) != now.get(name):
                lines.append(f"{noun}{name}: {before.get(name, 'absent')} -> {now.get(name, 'absent')}")
    for name, now in ingredients.items():
        if name not in old.stages:
            lines.append(f"stage {name} is new")
        elif old.stages[name].ingredients:
            before = {key: value for key, value in old.stages[name].ingredients.items() if key != "inputs"}
            now = {key: value for key, value in now.items() if key != "inputs"}
            lines += [f"stage {name}: {line}" for line in differences(before, now)]
    lines += [f"stage {name} is gone" for name in old.stages if name not in ingredients]
    return lines


def refuse_unlocked(folder: RunFolder, lines: list[str]) -> None:
    """Raise ConfigurationError that lists what differs from the manifest."""
    if lines:
        listed = "\n".join(f"  {line}" for line in lines)
        raise ConfigurationError(
            f"{folder.manifest}: --locked, but this would be another run:\n{listed}\n"
            "bring these back, or run without --locked"
        )
