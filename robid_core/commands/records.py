"""`robid records`: what a recording holds, in any format that a reader is installed for; recovery of cut ones."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

_RECOVER = "recover"


def command(
    words: Annotated[list[str], typer.Argument(metavar="[recover] FILE", help="A recording.")],
    form: Annotated[str, typer.Option("--format", help="Reader; by default from the file's suffix.")] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Where `recover` writes the record (HDF5).")
    ] = None,
) -> None:
    """Say what a recording holds: channels, lengths, what is wrong with it.

    `robid records recover FILE` saves what is left of a raw log that was cut, missing samples marked as such.
    """
    recover = len(words) == 2 and words[0] == _RECOVER
    if len(words) != 1 and not recover:
        raise typer.BadParameter("give one file, or `recover` and one file")
    file = Path(words[-1])
    reader = reader_of(file, form)
    if recover:
        typer.echo("\n".join(recovered(file, reader, output or file.with_suffix(".recovered.h5"))))
        return
    typer.echo(
        "\n".join([f"{file} ({file.stat().st_size} bytes)", *(f"  {line}" for line in reader.describe(file))])
    )


def reader_of(file: Path, form: str) -> Any:
    """Return the reader of a recording; raises ConfigurationError where there is no file or no reader."""
    from robid_core.errors import ConfigurationError
    from robid_core.registry import RECORDS, registry

    if not file.is_file():
        raise ConfigurationError(f"{file}: there is no such file")
    suffix = file.name.removesuffix(".part").rpartition(".")[2].lower()
    known = registry().names(RECORDS)
    if not form and suffix not in known:
        raise ConfigurationError(
            f"{file}: no reader for '.{suffix}'; give --format, one of {', '.join(known)}"
        )
    return registry().load(RECORDS, form or suffix)


def recovered(file: Path, reader: Any, output: Path) -> list[str]:
    """Write what is left of a raw log as a record, and say what it is."""
    from robid_core.errors import ConfigurationError, StoreError

    if not hasattr(reader, "read_record"):
        raise ConfigurationError(
            f"{file}: this format has nothing to recover; `robid records {file}` says what it holds"
        )
    if output.exists():
        raise StoreError(f"{output}: exists already and is not overwritten; give --output")
    record = reader.read_record(file)
    record.write(output)
    lines = [f"{output}: written"]
    for run in record.runs:
        n_valid, n_all = int(run.valid.sum()), run.valid.size
        lines.append(
            f"  recovered {n_valid * run.sample_time_s:.3f} of {n_all * run.sample_time_s:.3f} s of each axis"
        )
    return lines
