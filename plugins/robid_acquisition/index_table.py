"""Tables that say what lies where: one line for each experiment, with its file, its place and its conditions.

Columns `file`, `configuration`, `block`, `experiment`, `start_s`, `stop_s`, `role` and `variant`, of which only the
first must be there; without the next three, the lines of a variant are experiments 1, 2, ... of one block. Any other
column is a constant of the experiment, a number (a payload, a temperature), unless its name begins with '#'. Separated
by commas, semicolons or tabs; files are named relative to the table's folder.
"""

from __future__ import annotations

import csv
import difflib
import glob
import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import TypeVar

from robid_acquisition.data_file import below_root
from robid_acquisition.recording import Recording, is_test
from robid_core import ConfigurationError, DataRejected, is_recording

COLUMNS = ("file", "configuration", "block", "experiment", "start_s", "stop_s", "role", "variant")
COMMENT = "#"  # begins the name of a column that is left out
ALIKE = 0.75  # a name that is so near to one of these is a typing error, not a constant
SHOWN = 3  # files in a message
Value = TypeVar("Value")


def read_index(root: Path, index: str) -> list[Recording]:
    """Return the recordings that a table lists, in its order; `index` is the table's file below `root`.

    Raises
    ------
    DataRejected
        If the table cannot be read; the message has its line.
    ConfigurationError
        If a file that it lists is not there.
    """
    path = root / index
    lines = _lines(path, index)
    header = lines[0][1]
    _check_header(header, index)
    rows = [(number, _row(index, number, header, cells)) for number, cells in lines[1:]]
    if not rows:
        raise DataRejected(f"{index}: the table has a header and no line; write one for each experiment")
    constants = [name for name in header if name not in COLUMNS and not name.startswith(COMMENT)]
    folder = PurePosixPath(index).parent
    if "variant" in header and any("variant" not in row for _, row in rows):
        number = next(number for number, row in rows if "variant" not in row)
        raise DataRejected(
            f"{index}:{number}: there is no variant in this line; name one in every line, or in none"
        )
    recordings = [_recording(index, number, row, folder, constants) for number, row in rows]
    if not {"configuration", "block", "experiment"}.intersection(header):
        recordings = _numbered(recordings)
    missing = sorted({recording.file for recording in recordings if not is_recording(root / recording.file)})
    if missing:
        shown = ", ".join(missing[:SHOWN]) + (", ..." if len(missing) > SHOWN else "")
        count = "1 file that is" if len(missing) == 1 else f"{len(missing)} files that are"
        raise ConfigurationError(
            f"{index} lists {count} not in {root}: {shown}; {_instead(root, missing[0])}"
        )
    return recordings


def _instead(root: Path, missing: str) -> str:
    """Say what lies where a file was to be."""
    path = root / missing
    if path.is_dir():
        return f"{missing} is a folder, and no bag of ROS 2 (which has a metadata.yaml)"
    there = (
        sorted(one.name for one in path.parent.glob(f"{glob.escape(path.name)}.*"))
        if path.parent.is_dir()
        else []
    )
    if there:
        return f"{there[0]} is there: write names with their suffix"
    return "files are named relative to the table"


def _numbered(recordings: Iterable[Recording]) -> list[Recording]:
    """Return recordings as experiments of one block, counted in each variant."""
    count: Counter[str] = Counter()
    numbered = []
    for recording in recordings:
        count[recording.variant] += 1
        numbered.append(replace(recording, experiment=count[recording.variant]))
    return numbered


def _lines(path: Path, index: str) -> list[tuple[int, list[str]]]:
    """Return (line number, cells) of every line that is not empty."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataRejected(f"{index}: not UTF-8 text at byte {error.start}; save it as UTF-8") from error
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror or error}") from error
    first = text.partition("\n")[0]
    reader = csv.reader(text.splitlines(), delimiter=max(",;\t", key=first.count))
    lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    lines = [(number, cells) for number, cells in lines if any(cells)]
    if not lines:
        raise DataRejected(f"{index}: the table is empty")
    return lines


def _check_header(header: list[str], index: str) -> None:
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise DataRejected(f"{index}:1: two columns are called '{twice}'; rename one")
    for name in header:
        near = difflib.get_close_matches(name, COLUMNS, n=1, cutoff=ALIKE)
        near = near or [known for known in COLUMNS if len(name) >= 3 and known.startswith(name.lower())]
        if name not in COLUMNS and near:
            raise DataRejected(f"{index}:1: there is no column '{name}'; did you mean '{near[0]}'?")
    if "file" not in header:
        raise DataRejected(
            f"{index}:1: the column 'file' is missing; it has {', '.join(header)}, known are {', '.join(COLUMNS)}"
        )


def _row(index: str, number: int, header: list[str], cells: list[str]) -> dict[str, str]:
    if len(cells) != len(header):
        raise DataRejected(
            f"{index}:{number}: {len(cells)} cells where the first line has {len(header)}; correct or remove the line"
        )
    return {name: cell for name, cell in zip(header, cells, strict=True) if cell}


def _recording(
    index: str, number: int, row: dict[str, str], folder: PurePosixPath, constants: list[str]
) -> Recording:
    """Return what a line says; empty cells are as absent."""

    def cell(name: str, make: Callable[[str], Value], what: str) -> Value | None:
        try:
            return make(row[name]) if name in row else None
        except ValueError as error:
            raise DataRejected(f"{index}:{number}: {name} '{row[name]}' is no {what}") from error

    def numbered(name: str) -> int:
        found = cell(name, _whole, "whole number")
        return 1 if found is None else found

    def constant(name: str) -> float:
        found = cell(name, float, f"number; constants are numbers, '{COMMENT}{name}' is left out")
        return math.nan if found is None else found

    if "file" not in row:
        raise DataRejected(f"{index}:{number}: there is no file in this line")
    file = (folder / row["file"]).as_posix()
    try:
        below_root(file)
    except ValueError as error:
        raise DataRejected(f"{index}:{number}: {error}") from error
    return Recording(
        file=file,
        configuration=numbered("configuration"),
        block=numbered("block"),
        experiment=numbered("experiment"),
        start_s=cell("start_s", _seconds, "time in seconds"),
        stop_s=cell("stop_s", _seconds, "time in seconds"),
        variant=row.get("variant", ""),
        test=is_test(row.get("role", "train"), f"{index}:{number}"),
        constants={name: constant(name) for name in constants},
    )


def _whole(cell: str) -> int:
    value = int(cell)
    if value < 0:
        raise ValueError(cell)
    return value


def _seconds(cell: str) -> float:
    value = float(cell)
    if not 0 <= value < math.inf:
        raise ValueError(cell)
    return value
