"""The page of `robid diff`: the last fit of each run beside the others, and their last responses overlaid."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from robid_core.errors import ConfigurationError, StoreError

if TYPE_CHECKING:
    from robid_core.artifacts import Artifact
    from robid_core.run import RunFolder

Kind = TypeVar("Kind", bound="Artifact")
STAGE = "report.comparison"


def write_page(folders: Sequence[RunFolder], page: Path) -> None:
    """Write the page of a comparison.

    Raises
    ------
    ConfigurationError
        If a run has no fit.
    StoreError
        If an artifact was changed since, or the page cannot be written.
    """
    from robid_core.artifacts import Fit, Frf
    from robid_core.registry import STAGES, registry

    labels = labels_of(folders)
    fits = [last_of(folder, Fit) for folder in folders]
    for folder, fit in zip(folders, fits, strict=True):
        if fit is None:
            raise ConfigurationError(
                f"{folder.path}: the run has no fit to compare; add a stage of kind fit and run"
            )
    measured = {
        label: frf
        for label, folder in zip(labels, folders, strict=True)
        if (frf := last_of(folder, Frf)) is not None
    }
    stage = registry().load(STAGES, STAGE)(labels=labels, response_labels=tuple(measured))
    report = stage.run(fits=tuple(fits), frfs=tuple(measured.values()))
    try:
        page.write_text(report.html, encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{page}: cannot be written: {error.strerror}; name another file") from error


def labels_of(folders: Sequence[RunFolder]) -> tuple[str, ...]:
    """Return a name of its own for each run: of its folder, with its path where two are called the same."""
    names = [folder.path.resolve().name for folder in folders]
    if len(set(names)) == len(names):
        return tuple(names)
    paths = [str(folder.path) for folder in folders]
    if len(set(paths)) < len(paths):
        raise ConfigurationError(f"{paths[0]}: a run is named twice; name each run once")
    return tuple(paths)


def last_of(folder: RunFolder, kind: type[Kind]) -> Kind | None:
    """Return the last result of a kind in a run, verified; None where there is none."""
    from robid_core.run.results import manifest_of, result_path

    manifest = manifest_of(folder)
    made = [
        name for name, record in manifest.stages.items() if record.artifact == kind.__name__ and record.file
    ]
    return kind.read(result_path(folder, manifest, made[-1])) if made else None
