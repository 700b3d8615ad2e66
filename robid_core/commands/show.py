"""`robid show`: an artifact readably, or the list of what a run made."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robid_core.commands.arguments import DEFAULT_PIPELINE

if TYPE_CHECKING:
    from robid_core.artifacts import Artifact, Design, Diagnosis, Fit, Frf
    from robid_core.run import Manifest, RunFolder


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
    from robid_core.errors import ConfigurationError
    from robid_core.run.results import manifest_of, read_artifact, result_path

    if where == DEFAULT_PIPELINE or where.exists():
        wanted = where
    elif stage is not None or len(where.parts) > 1:
        raise ConfigurationError(no_such_run(where))
    else:  # `robid show fit`
        wanted, stage = DEFAULT_PIPELINE, str(where)
    if wanted.suffix in (".h5", ".html") and stage is None:
        typer.echo("\n".join([*artifact_lines(read_artifact(wanted), wanted), verification_line(wanted)]))
        return
    try:
        folder = run_of(wanted)
    except ConfigurationError:
        if wanted == where:
            raise
        raise ConfigurationError(no_such_run(where)) from None  # neither a run, nor a stage of one here
    manifest = manifest_of(folder)
    if stage is None:
        typer.echo("\n".join(run_lines(folder, manifest)))
        return
    path = result_path(folder, manifest, stage)
    typer.echo("\n".join([*artifact_lines(read_artifact(path), path), verification_line(path)]))


def no_such_run(where: Path) -> str:
    """Say that a path is no run, and which runs there are beside it, or else here."""
    for folder in (where.parent, Path("runs")):
        found = sorted(str(path.parent) for path in folder.glob("*/manifest.json"))
        if found:
            return f"{where}: no such run; there are: {', '.join(found)}"
    return f"{where}: no such run; robid run makes one in {Path('runs')}"


def run_of(where: Path) -> RunFolder:
    """Return the run that a person means; ConfigurationError, which names `robid records` for a recording."""
    from robid_core.commands.recordings.inspection import known_reader
    from robid_core.errors import ConfigurationError
    from robid_core.foreign import is_recording
    from robid_core.run import RunFolder

    try:
        return RunFolder.find(where)
    except ConfigurationError as error:
        if not is_recording(where) or not known_reader(where):
            raise
        told = f"{where}: a recording, and no result of a run; `robid records {where}` says what it holds"
        raise ConfigurationError(told) from error


def verification_line(path: Path) -> str:
    """Say whether a file is what was written; StoreError where it is not."""
    from robid_core.artifacts import seal
    from robid_core.run.manifest import DamagedManifest
    from robid_core.run.results import refuse_damaged
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


def run_lines(folder: RunFolder, manifest: Manifest) -> list[str]:
    """Return what a run made: one line per stage; and why its results should be doubted."""
    from robid_core.commands.fit_screen import doubt_lines
    from robid_core.run.folded import folded
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
    found: dict[str, list[str]] = {"doubt": [], "remark": []}
    for name, record in manifest.stages.items():
        found["doubt"] += [f"stage {name}: {text}" for text in record.warnings]
    for name, record in manifest.stages.items():
        for doubt in record.doubts:
            text = f"stage {name}: {doubt['sentence']}; {doubt['remedy']}"
            found[doubt.get("degree", "doubt")].append(text)
    if any(found.values()):
        lines += ["", *doubt_lines(folded(found["doubt"]), found["remark"])]
    changed = changed_files(folder, manifest)
    if changed:
        lines += ["", *changed]
    return [
        *lines,
        "",
        f"in {folder.path}; one of them: {shlex.join(['robid', 'show', str(folder.path)])} STAGE",
    ]


def artifact_lines(artifact: Artifact, path: Path | None = None) -> list[str]:
    """Return an artifact as text: what is special about its kind first, then every field; of a diagnosis its tables."""
    from robid_core.artifacts import Design, Diagnosis, Excitation, Fit, Frf, Report
    from robid_core.artifacts.fields import field_lines
    from robid_core.commands.diagnosis_screen import diagnosis_lines
    from robid_core.commands.excitation_screen import advice_lines
    from robid_core.commands.fit_screen import essential_lines, fit_line, fit_table, misfit_lines

    lines = [type(artifact).__name__ + (f" in {path}" if path is not None else "")]
    if isinstance(artifact, Report):
        return [*lines, f"  a page of {len(artifact.html) / 1000:.0f} kB; open it in a browser"]
    if isinstance(artifact, Fit):
        lines += [
            f"  {artifact.method}: {fit_line(artifact)}",
            *_degrees(artifact),
            "",
            *(f"  {line}" for line in fit_table(artifact, {}, everything=True)),
            "",
        ]
        if artifact.essential is not None:
            lines += [*(f"  {line}" for line in essential_lines(artifact.essential)), ""]
        if artifact.misfit_table is not None:
            lines += [*(f"  {line}" for line in misfit_lines(artifact.misfit_table)), ""]
    elif isinstance(artifact, Frf):
        lines += _frf_lines(artifact)
    elif isinstance(artifact, Excitation):
        lines += [*(f"  {line}" for line in advice_lines(artifact)), ""]
    elif isinstance(artifact, Design):
        lines += _design_lines(artifact)
    elif isinstance(artifact, Diagnosis):
        return [
            *lines,
            *_degrees(artifact),
            "",
            *(f"  {line}".rstrip() for line in diagnosis_lines(artifact)),
        ]
    return [*lines, *field_lines(artifact)]


def _degrees(artifact: Fit | Diagnosis) -> list[str]:
    from robid_core.commands.fit_screen import doubt_lines

    remarks = [doubt for doubt in artifact.doubts if doubt.is_remark]
    return doubt_lines([doubt for doubt in artifact.doubts if not doubt.is_remark], remarks)


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
