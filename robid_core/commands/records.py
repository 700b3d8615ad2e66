"""`robid records`: what recordings hold, in any format that a reader is installed for; recovery of cut ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robid_core.commands.arguments import DataRoot

if TYPE_CHECKING:
    from robid_core.artifacts import Record
    from robid_core.commands.recordings.inspection import Inspected

_RECOVER = "recover"


def command(
    words: Annotated[
        list[str],
        typer.Argument(metavar="[recover] PATH...", help="Recordings (files, bags of ROS), or folders."),
    ],
    form: Annotated[str, typer.Option("--format", help="Reader; by default from the file's suffix.")] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Where the stages are written, too, as a channel map; of `recover`: the record (HDF5).",
        ),
    ] = None,
    data: DataRoot = None,
) -> None:
    """Say what recordings hold, channel by channel: what each may be and why, range, rate, gaps, missing values.

    Ends with the stage that reads them, to be pasted into a pipeline; what is a guess is marked so. `--output` writes
    it to a file, too, which `robid diagnose --channels` takes.
    `robid records recover FILE` saves what is left of a raw log that was cut, missing samples marked as such.
    """
    from robid_core.errors import DataRejected

    if words[0] == _RECOVER and len(words) > 1:
        from robid_core.commands.recordings.inspection import reader_name
        from robid_core.foreign import guarded_reader

        if len(words) > 2:
            raise typer.BadParameter("`recover` takes one file")
        file = Path(words[1])
        reader = guarded_reader(reader_name(file, form))
        typer.echo("\n".join(recovered(file, reader, output or file.with_suffix(".recovered.h5"))))
        return
    shown, left_out = inspected([Path(word) for word in words], form)
    if left_out and not shown:
        raise DataRejected(f"none of {left_out} recordings could be read")
    if shown:
        lines = pipeline_lines(shown, data)
        typer.echo("\n".join(lines))
        if output is not None:
            write_map(output, lines)


def write_map(output: Path, lines: Sequence[str]) -> None:
    """Write a channel map; a file that exists is not overwritten, and nothing is written where there is no map."""
    from robid_core.errors import ConfigurationError, StoreError

    if len(lines) < 2:
        raise ConfigurationError(f"{output}: not written, since no channel was recognised")
    if output.exists():
        raise StoreError(f"{output}: exists already and is not overwritten; give another --output")
    output.write_text("\n".join(lines) + "\n", encoding="utf-8")
    typer.echo(
        f"\n{output}: written; check its guesses, then `robid diagnose --channels {output} ...` takes it"
    )


def inspected(paths: Sequence[Path], form: str) -> tuple[list[Inspected], int]:
    """Show recordings one after the other, and return them.

    Of several, what cannot be read is said and left out; how many such there are is returned, too.
    """
    from robid_core.commands.recordings.inspection import inspect, reader_name, recordings_in
    from robid_core.commands.recordings.screen import recording_lines, short_line
    from robid_core.errors import RobidError
    from robid_core.foreign import is_recording

    found: list[Inspected] = []
    left_out = 0
    for path in paths:
        for file in [path] if is_recording(path) or not path.is_dir() else recordings_in(path):
            reader_name(file, form)
            try:
                one = inspect(file, form)
            except RobidError as error:
                if len(paths) == 1 and not path.is_dir():
                    raise
                typer.echo(f"{file}: left out: {error}")
                left_out += 1
                continue
            alike = one.guesses is not None and any(one.kind == other.kind for other in found)
            typer.echo(short_line(one) if alike else "\n".join([*recording_lines(one), ""]))
            found.append(one)
    return found, left_out


def pipeline_lines(recordings: Sequence[Inspected], data: Path | None) -> list[str]:
    """Return the stages that read recordings, and where their paths begin."""
    from robid_core.commands.recordings.acquisition import data_root, stage_lines
    from robid_core.pipeline.places import find_places

    known = find_places(Path.cwd() / "pipeline.yaml", data).data_root
    root = data_root([one.file for one in recordings], known)
    lines = stage_lines(recordings, root)
    if not lines:
        return ["no channel was recognised; robid stages acquisition.recorded says how to name them"]
    where = "" if root == known else f"; paths begin in {root}: robid run --data {root}"
    return [f"# to be pasted into a pipeline; check every guess{where}", *lines]


def recovered(file: Path, reader: Any, output: Path) -> list[str]:
    """Write what is left of a raw log as a record, and say what it is."""
    from robid_core.errors import ConfigurationError, StoreError

    if not hasattr(reader, "read_record"):
        raise ConfigurationError(
            f"{file}: this format has nothing to recover; `robid records {file}` says what it holds"
        )
    if output.exists():
        raise StoreError(f"{output}: exists already and is not overwritten; give --output")
    record, told = whole_configurations(reader.read_record(file))
    record.write(output)
    lines = [f"{output}: written{told}"]
    for run in record.runs:
        n_valid, n_all = int(run.valid.sum()), run.valid.size
        lines.append(
            f"  recovered {n_valid * run.sample_time_s:.3f} of {n_all * run.sample_time_s:.3f} s of each axis"
        )
    return lines


def whole_configurations(record: Record) -> tuple[Record, str]:
    """Return a record without the configurations that are cut, which most stages refuse, and say which they are."""
    import numpy as np

    if len(record.runs) != 1 or record.run.valid.all():
        return record, ""
    whole = np.asarray(record.run.valid.all(axis=(1, 2, 3, 4)))
    if not whole.any():
        return record, "; no configuration is whole, and what needs whole periods refuses it"
    cut = ", ".join(str(i + 1) for i in np.flatnonzero(~whole))
    kept = np.broadcast_to(whole[:, None, None], record.run.valid.shape[:3])
    several = "configurations {}, which are cut" if "," in cut else "configuration {}, which is cut"
    return record.part(kept), f"; left out: {several.format(cut)}"
