"""The page of `robid diff`: a fit of each run beside the others, and their last responses overlaid."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from robid_core.errors import ConfigurationError, StoreError

if TYPE_CHECKING:
    from robid_core.artifacts import Artifact
    from robid_core.run import Manifest, RunFolder

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
    from robid_core.run.results import manifest_of

    labels = labels_of(folders)
    stages = compared_stages([manifest_of(folder) for folder in folders])
    fits = []
    for folder, stage in zip(folders, stages, strict=True):
        fit = last_of(folder, Fit, stage)
        if fit is None:
            raise ConfigurationError(
                f"{folder.path}: the run has no fit to compare; add a stage of kind fit and run"
            )
        fits.append(fit)
    measured = {
        label: frf
        for label, folder in zip(labels, folders, strict=True)
        if (frf := last_of(folder, Frf)) is not None
    }
    named = dict.fromkeys(name for name in stages if name)
    page_stage = registry().load(STAGES, STAGE)(
        title=f"Comparison of {', '.join(named)}", labels=labels, response_labels=tuple(measured)
    )
    report = page_stage.run(fits=tuple(fits), frfs=tuple(measured.values()))
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


def compared_stages(manifests: Sequence[Manifest]) -> list[str]:
    """Return the fit to compare of each run: the last one that all have and that differs, else the last of each.

    Empty for a run without a fit.
    """
    from robid_core.artifacts import Fit

    fits = [
        [name for name, record in one.stages.items() if record.artifact == Fit.__name__ and record.file]
        for one in manifests
    ]
    shared = [name for name in fits[0] if all(name in names for names in fits)]
    differing = [name for name in shared if len({one.stages[name].sha256 for one in manifests}) > 1]
    if differing:
        return [differing[-1]] * len(manifests)
    return [names[-1] if names else "" for names in fits]


def last_of(folder: RunFolder, kind: type[Kind], stage: str = "") -> Kind | None:
    """Return the last result of a kind in a run, or that of a stage, verified; None where there is none."""
    from robid_core.run.results import manifest_of, result_path

    manifest = manifest_of(folder)
    made = [
        name
        for name, record in manifest.stages.items()
        if record.artifact == kind.__name__ and record.file and stage in ("", name)
    ]
    return kind.read(result_path(folder, manifest, made[-1])) if made else None
