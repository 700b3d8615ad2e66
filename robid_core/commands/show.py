"""`robid show`: an artifact readably, or the list of what a run made."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robid_core.commands.arguments import DEFAULT_PIPELINE
from robid_core.errors import ConfigurationError, StoreError

if TYPE_CHECKING:
    from robid_core.artifacts import Artifact, Design, Frf
    from robid_core.run import Manifest, RunFolder

LONGEST_TEXT = 60
MOST_NAMES = 8


def command(
    where: Annotated[
        Path,
        typer.Argument(
            metavar="[RUN]",
            help="A run's folder, its pipeline file, or an artifact.",
            show_default="pipeline.yaml",
        ),
    ] = DEFAULT_PIPELINE,
    stage: Annotated[
        str | None, typer.Argument(metavar="[STAGE]", help="The stage whose result to show.")
    ] = None,
) -> None:
    """Show a result: its fields with axes, units and ranges; a fit as its table. Without a stage: what a run made."""
    from robid_core.run import RunFolder

    if where == DEFAULT_PIPELINE or where.exists():
        wanted = where
    else:  # `robid show fit`
        wanted, stage = DEFAULT_PIPELINE, str(where)
    if wanted.suffix in (".h5", ".html") and stage is None:
        typer.echo("\n".join([*artifact_lines(_read(wanted), wanted), verification_line(wanted)]))
        return
    folder = RunFolder.find(wanted)
    manifest = manifest_of(folder)
    if stage is None:
        typer.echo("\n".join(run_lines(folder, manifest)))
        return
    record = manifest.stages.get(stage)
    if record is None or not record.file:
        made = ", ".join(name for name, known in manifest.stages.items() if known.file)
        why = f"gave no result: {record.note}" if record is not None else "is not in this run"
        raise ConfigurationError(f"{folder.path}: stage '{stage}' {why}; there are: {made}")
    path = folder.path / record.file
    refuse_damaged(path, record.sha256)
    typer.echo("\n".join(artifact_lines(_read(path), path)))


def verification_line(path: Path) -> str:
    """Say whether a file is what was written; StoreError where it is not."""
    from robid_core.artifacts import seal
    from robid_core.run.manifest import DamagedManifest
    from robid_core.run.verification import known_hash

    try:
        sha256 = known_hash(path)
    except DamagedManifest as error:
        sha256, why = "", error.damage
    else:
        why = "no manifest beside it knows this file"
    if sha256:
        refuse_damaged(path, sha256)
        return "  verified: these are the bytes that the run made"
    if path.suffix == ".h5" and seal.is_intact(path):
        return "  verified: these are the bytes that were written"
    return f"  not verified: {why}, and it has no seal"


def refuse_damaged(path: Path, sha256: str) -> None:
    """Raise StoreError where a result is not the one that the manifest knows."""
    if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() != sha256:
        raise StoreError(
            f"{path}: not what the run made, it was changed or damaged; robid run makes it again"
        )


def manifest_of(folder: RunFolder) -> Manifest:
    from robid_core.run import Manifest

    manifest = Manifest.read(folder)
    if manifest is None:
        raise ConfigurationError(f"{folder.path}: there is no manifest; run the pipeline first")
    return manifest


def _read(path: Path) -> Artifact:
    """Read whatever artifact a file holds."""
    from robid_core.artifacts import Artifact, Report

    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file; robid run makes it")
    return Report.read(path) if path.suffix == Report.suffix else Artifact.read(path)


def run_lines(folder: RunFolder, manifest: Manifest) -> list[str]:
    """Return what a run made: one line per stage; and why its fits should be doubted."""
    from robid_core.commands.fit_screen import doubt_lines
    from robid_core.run.verification import changed_files

    lines = [
        f"{manifest.name}: {manifest.status}, {manifest.finished or manifest.started}, seed {manifest.seed}, "
        f"robot {manifest.robot['written']}",
        "",
    ]
    rows = [["stage", "result", "of this run", "file", "sha256"]]
    for name, record in manifest.stages.items():
        what = {"earlier": "no, an earlier one", "refused": "refused"}.get(record.outcome, "yes")
        rows.append(
            [name, record.artifact or "-", what, record.file or record.note or "-", record.sha256[:12]]
        )
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines += [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]
    doubts = [
        f"stage {name}: {doubt['sentence']}; {doubt['remedy']}"
        for name, record in manifest.stages.items()
        for doubt in record.doubts
    ]
    if doubts:
        lines += ["", *doubt_lines(doubts)]
    changed = changed_files(folder, manifest)
    if changed:
        lines += ["", *changed]
    return [*lines, "", f"in {folder.path}; one of them: robid show {folder.path} STAGE"]


def artifact_lines(artifact: Artifact, path: Path | None = None) -> list[str]:
    """Return an artifact as text: what is special about its kind first, then every field."""
    from robid_core.artifacts import Design, Diagnosis, Excitation, Fit, Frf, Report
    from robid_core.commands.excitation_screen import advice_lines
    from robid_core.commands.fit_screen import doubt_lines, fit_line, fit_table, misfit_lines

    lines = [type(artifact).__name__ + (f" in {path}" if path is not None else "")]
    if isinstance(artifact, Report):
        return [*lines, f"  a page of {len(artifact.html) / 1000:.0f} kB; open it in a browser"]
    if isinstance(artifact, Fit):
        lines += [
            f"  {artifact.method}: {fit_line(artifact)}",
            *doubt_lines(artifact.doubts),
            "",
            *(f"  {line}" for line in fit_table(artifact, {}, everything=True)),
            "",
        ]
        if artifact.misfit_table is not None:
            lines += [*(f"  {line}" for line in misfit_lines(artifact.misfit_table)), ""]
    elif isinstance(artifact, Frf):
        lines += _frf_lines(artifact)
    elif isinstance(artifact, Excitation):
        lines += [*(f"  {line}" for line in advice_lines(artifact)), ""]
    elif isinstance(artifact, Design):
        lines += _design_lines(artifact)
    elif isinstance(artifact, Diagnosis):
        lines += [f"  {artifact.method}: {artifact.verdict}", ""]
    return [*lines, *field_lines(artifact)]


def _frf_lines(frf: Frf) -> list[str]:
    from robid_core.artifacts import Frf as FrfClass

    unit = FrfClass.unit("response")
    low, high = frf.frequency_hz.min(), frf.frequency_hz.max()
    lines = [
        f"  {frf.estimator} ({frf.pooling}): {len(frf.frequency_hz)} lines, {low:.4g} to {high:.4g} Hz, in {unit}",
        "  configuration  usable lines  angle in rad",
    ]
    for index, (angle, valid) in enumerate(zip(frf.angle, frf.valid_lines, strict=True)):
        joined = " ".join(f"{value:8.3f}" for value in angle)
        lines.append(f"  {index:13d}  {int(valid.sum()):5d} of {len(valid):3d}  {joined}")
    return [*lines, ""]


def _design_lines(design: Design) -> list[str]:
    lines = [
        f"  criterion {design.criterion}: gap {design.gap:.3g}, efficiency after rounding {design.efficiency:.4f}",
        "  configuration  weight  experiments  angle in rad",
    ]
    for index, angle in enumerate(design.angle):
        joined = " ".join(f"{value:8.3f}" for value in angle)
        lines.append(
            f"  {index:13d}  {design.weight[index]:6.3f}  {int(design.experiments[index]):11d}  {joined}"
        )
    return [*lines, ""]


def field_lines(artifact: Artifact, indent: str = "  ") -> list[str]:
    """Return every field: arrays with axes, unit and range; nested artifacts below their name."""
    from robid_core.artifacts import Artifact

    lines = []
    for item in dataclasses.fields(artifact):
        value = getattr(artifact, item.name)
        if "axes" in item.metadata:
            lines.append(f"{indent}{item.name}: {_array_text(value, item.metadata)}")
            continue
        nested: dict[str, Any] = {}
        if isinstance(value, Artifact):
            nested = {item.name: value}
        elif isinstance(value, dict):
            nested = {f"{item.name}[{key}]": entry for key, entry in value.items()}
        elif isinstance(value, tuple) and value and isinstance(value[0], Artifact):
            nested = {f"{item.name}[{index}]": entry for index, entry in enumerate(value)}
        if not nested:
            lines.append(f"{indent}{item.name}: {_plain_text(value)}")
        for name, entry in nested.items():
            lines += [f"{indent}{name}: {type(entry).__name__}", *field_lines(entry, indent + "  ")]
    return lines


def _array_text(value: Any, metadata: Any) -> str:
    import numpy as np

    if value is None:
        return "absent"
    axes = " x ".join(f"{length} {name}" for name, length in zip(metadata["axes"], value.shape, strict=True))
    unit = f" {metadata['unit']}" if metadata["unit"] else ""
    if value.size == 0:
        return f"{axes}, empty"
    if value.dtype == bool:
        return f"{axes}, {int(value.sum())} of {value.size} true"
    size = np.abs(value) if np.iscomplexobj(value) else value
    finite = size[np.isfinite(size)]
    missing = f", {size.size - finite.size} without a value" if finite.size < size.size else ""
    if not finite.size:
        return f"{axes}{missing}"
    what = "size " if np.iscomplexobj(value) else ""
    return f"{axes}, {what}{finite.min():.4g} to {finite.max():.4g}{unit}{missing}"


def _plain_text(value: Any) -> str:
    if isinstance(value, tuple):
        shown = ", ".join(str(entry) for entry in value[:MOST_NAMES])
        return (shown or "none") + (f", ... ({len(value)})" if len(value) > MOST_NAMES else "")
    if isinstance(value, float):
        return f"{value:.6g}"
    text = "absent" if value is None else " ".join(str(value).split())
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 3] + "..."
