"""What a run left in its folder: the manifest and the artifacts, which must be those that the run made."""

from __future__ import annotations

import hashlib
from pathlib import Path

from robid_core.artifacts import Artifact, Report
from robid_core.errors import ConfigurationError, StoreError
from robid_core.run.folder import RunFolder
from robid_core.run.manifest import Manifest


def manifest_of(folder: RunFolder) -> Manifest:
    """Return the manifest of a run; ConfigurationError where there is none."""
    manifest = Manifest.read(folder)
    if manifest is None:
        raise ConfigurationError(f"{folder.path}: there is no manifest; run the pipeline first")
    return manifest


def result_path(folder: RunFolder, manifest: Manifest, stage: str) -> Path:
    """Return the file of a stage's result.

    Raises ConfigurationError where the stage gave none, and StoreError where the file was changed since.
    """
    record = manifest.stages.get(stage)
    if record is None or not record.file:
        made = ", ".join(name for name, known in manifest.stages.items() if known.file)
        why = f"gave no result: {record.note}" if record is not None else "is not in this run"
        raise ConfigurationError(f"{folder.path}: stage '{stage}' {why}; there are: {made}")
    path = folder.path / record.file
    refuse_damaged(path, record.sha256)
    return path


def refuse_damaged(path: Path, sha256: str) -> None:
    """Raise StoreError where a result is not the one that the manifest knows."""
    if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() != sha256:
        raise StoreError(
            f"{path}: not what the run made, it was changed or damaged; robid run makes it again"
        )


def read_artifact(path: Path) -> Artifact:
    """Read whatever artifact a file holds."""
    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file; robid run makes it")
    return Report.read(path) if path.suffix == Report.suffix else Artifact.read(path)
