"""What a manifest says of the files of its run, held against them: artifacts by name, and raw logs.

The store verifies what a run reads; this is for people, who open the files by their names.
"""

from __future__ import annotations

import re
from pathlib import Path

from robid_core.run.folder import RunFolder
from robid_core.run.manifest import Manifest
from robid_core.store import Files, failures_named

UNFINISHED = ".part"


def raw_logs(folder: RunFolder, stage: str) -> dict[str, str]:
    """Return the sha256 of the complete raw logs of a stage, by their names relative to the run's folder.

    A motion of hardware has a folder of its own, `raw/<stage>-<number>`; a simulated one overwrites its log.
    """
    own = re.compile(rf"{re.escape(stage)}-[0-9]+")
    folders = [folder.raw, *folder.raw.glob(f"{stage}-*")]
    files = [
        file
        for place in folders
        if place == folder.raw or own.fullmatch(place.name)
        for file in sorted(place.glob(f"{stage}.*"))
        if file.is_file() and file.suffix != UNFINISHED
    ]
    with failures_named("read", folder.raw):
        return {file.relative_to(folder.path).as_posix(): Files().digest(file) for file in sorted(files)}


def changed_files(folder: RunFolder, manifest: Manifest) -> list[str]:
    """Return what is no longer as the run left it, a sentence each."""
    known: dict[str, str] = {}
    for record in manifest.stages.values():
        known |= dict(record.raw)
        if record.file:
            known[record.file] = record.sha256
    return [words for file, sha256 in known.items() if (words := _change(folder.path / file, sha256))]


def _change(path: Path, sha256: str) -> str:
    with failures_named("read", path):
        if not path.is_file():
            return f"R06: {path}: is missing"
        found = Files().digest(path)
    return "" if found == sha256 else f"R06: {path}: changed or damaged since the run made it"


def known_hash(path: Path) -> str:
    """Return the sha256 that the manifest of the run around a file has for it; empty where there is none.

    Raises what `Manifest.read` raises.
    """
    full = path.resolve()
    for place in full.parents[1:4]:
        if (place / "manifest.json").is_file():
            manifest = Manifest.read(folder := RunFolder(place))
            for record in manifest.stages.values() if manifest is not None else ():
                for file, sha256 in {record.file: record.sha256, **record.raw}.items():
                    if file and folder.path / file == full:
                        return sha256
            return ""
    return ""
