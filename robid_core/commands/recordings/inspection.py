"""Recordings looked at, one after the other: what their reader says, their columns, and what these may be."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robid_core.arrays import FloatArray
from robid_core.commands.recordings.guesses import Guesses, guess_channels
from robid_core.commands.recordings.motion import Motion, Repeats, motion_of
from robid_core.errors import ConfigurationError, RobidError
from robid_core.foreign import BAG_READER, guarded_reader, is_bag, is_recording
from robid_core.registry import RECORDS, record_readers, registry


@dataclass(frozen=True)
class Inspected:
    """A recording: `lines` are for people; `guesses` is None where it is a record of robid, or holds no columns."""

    file: Path
    reader_name: str
    lines: tuple[str, ...]
    guesses: Guesses | None = None
    is_record: bool = False
    motion: Motion | None = None
    """None where no position was recognised."""

    @property
    def repeats(self) -> Repeats | None:
        """How it repeats, if it does."""
        return self.motion.repeats if self.motion is not None else None

    @property
    def kind(self) -> tuple[object, ...]:
        """What recordings have in common that one map of channels fits."""
        if self.guesses is None:
            return self.reader_name, self.is_record
        columns = tuple(sorted((one.columns, one.meaning) for one in self.guesses.channels))
        return self.reader_name, columns


def reader_name(file: Path, form: str) -> str:
    """Return the name of a recording's reader; raises ConfigurationError where there is no file or no reader."""
    if not is_recording(file):
        raise ConfigurationError(f"{file}: {'is no file' if file.exists() else 'there is no such file'}")
    if form:
        return form
    name = known_reader(file)
    if not name:
        known = ", ".join(registry().names(RECORDS))
        table = (
            "save its table as CSV, or " if file.suffix.lower() in (".xlsx", ".xls", ".xlsm", ".ods") else ""
        )
        raise ConfigurationError(
            f"{file}: no reader for '{file.suffix}'; {table}give --format, one of {known}"
        )
    return name


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder and those below, bags as their folders.

    Raises ConfigurationError where there are none.
    """
    files = [
        file
        for file in sorted(folder.rglob("*"))
        if is_recording(file)
        and not is_bag(file.parent)
        and not any(part.startswith(".") for part in file.relative_to(folder).parts)
        and known_reader(file)
    ]
    if not files:
        known = ", ".join(registry().names(RECORDS))
        raise ConfigurationError(f"{folder}: holds no recording; there are readers for {known}")
    return files


def known_reader(file: Path) -> str:
    """Return the name of the reader for a file's name; empty where there is none."""
    suffix = file.name.removesuffix(".part").rpartition(".")[2].lower()
    if is_bag(file) or (suffix == "mcap" and is_bag(file.parent)):
        return BAG_READER if BAG_READER in registry().names(RECORDS) else ""
    return record_readers().get(suffix, "")


def inspect(file: Path, form: str = "") -> Inspected:
    """Read a recording and guess what it holds; raises what its reader raises."""
    name = reader_name(file, form)
    reader = guarded_reader(name)
    lines = tuple(reader.describe(file))
    with _quiet():  # what readers log stands in the description
        if _reads_record(reader, file):
            return Inspected(file, name, lines, is_record=True)
        try:
            columns = reader.read(file)
        except RobidError as error:
            return Inspected(file, name, (*lines, str(error)))
    units = reader.units(file) if hasattr(reader, "units") else {}
    guesses = guess_channels(columns, units, file.stem)
    return Inspected(file, name, _further(lines, columns), guesses, motion=motion_of(guesses, columns))


def is_record(file: Path) -> bool:
    """Whether a file is a record of robid, which needs no channel map; raises what a reader of columns raises."""
    reader = guarded_reader(reader_name(file, ""))
    with _quiet():
        if _reads_record(reader, file):
            return True
        reader.read(file)
    return False


def _reads_record(reader: Any, file: Path) -> bool:
    if not hasattr(reader, "read_record"):
        return False
    try:
        reader.read_record(file)
    except RobidError:
        return False
    return True


def _further(lines: tuple[str, ...], columns: dict[str, FloatArray]) -> tuple[str, ...]:
    """Return what a reader says beyond the shapes of columns and single numbers."""
    shapes = {
        f"{name}: {values.shape}" if values.ndim else f"{name}: {values.item():g}"
        for name, values in columns.items()
    }
    return tuple(
        line
        for line in lines
        if not any(
            line == shape or line.startswith((f"{shape} from ", f"{shape}, a constant")) for shape in shapes
        )
    )


@contextmanager
def _quiet() -> Iterator[None]:
    log = logging.getLogger("robid")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)
