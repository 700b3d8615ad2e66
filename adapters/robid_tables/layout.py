"""How a delimited text is laid out: what separates its cells, its header, its line of units, its comments.

Header and first lines are looked at together: the separator is the one by which lines of numbers have as many cells as
the header has names.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robid_core import DataRejected
from robid_tables.notation import MISSING, bare_unit, foreign_notation, is_number, is_unit

SEPARATORS = {";": "semicolon", "\t": "tab", "|": "vertical bar", ",": "comma", " ": "white space"}
COMMENTS = ("#", "%", "//")
LOOKED_AT = 20  # lines below the header
LONGEST_TITLE = 40  # lines above the header
_NAME = re.compile(
    r"\S+(?:\s*[\[(].*[\])])?"
)  # in a comment: a word, perhaps with its unit; prose has blanks
_CELL = re.compile(r'"([^"]*)"|(\S+)')

Line = tuple[int, str]  # number in the file, counted from 1; text


@dataclass(frozen=True)
class Layout:
    """Where the numbers of a table are.

    `body` holds the lines of numbers; `header` is empty where no line names the columns. `remarks` are for people.
    """

    separator: str
    names: tuple[str, ...]
    body: Sequence[Line]
    header: bool
    units: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def layout_of(path: Path, text: str) -> Layout:
    """Return the layout of a text.

    Raises
    ------
    DataRejected
        If there are no lines of numbers, names are missing or stand twice, or the first line may be names or data.
    """
    lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    comments: list[Line] = []
    if any(mark in text for mark in COMMENTS):
        comments = [line for line in lines if line[1].lstrip().startswith(COMMENTS)]
        lines = [line for line in lines if not line[1].lstrip().startswith(COMMENTS)]
    if not lines:
        what = "the file holds nothing but comments" if comments else "the file is empty"
        raise DataRejected(f"{path}: {what}")
    remarks = []
    if title := _title(lines):
        remarks.append(f"{title} line{'s' if title > 1 else ''} above the names of the columns left out")
        lines = lines[title:]
    sample = [line for _, line in lines[: LOOKED_AT + 1]]
    separator = _separator(sample[0], sample[1:])
    cells = split(sample[0], separator)
    if _is_header(path, lines, separator):
        names, first, lines = cells, lines[0][0], lines[1:]
        header = True
    else:
        before = [line for line in comments if line[0] < lines[0][0]]
        names, first = _commented_names(before, separator, len(_without_last_empty(cells))), lines[0][0]
        header = bool(names)
        if header:
            first = before[-1][0]
            remarks.append(f"the comment in line {first} names the columns")
        else:
            ended = separator != " " and all(line.rstrip(" ").endswith(separator) for _, line in lines)
            names = [str(index + 1) for index in range(len(cells) - ended)]
            if ended:  # an empty cell at the end is no missing number then
                lines = [(number, line.rstrip(" ").removesuffix(separator)) for number, line in lines]
    if header:
        names = _without_last_empty(names)
    _check_names(path, first, names)
    units: dict[str, str] = {}
    if header and lines and (found := _units(split(lines[0][1], separator), len(names))):
        units = {name: unit for name, unit in zip(names, found, strict=True) if unit}
        remarks.append(
            f"line {lines[0][0]} holds units: {', '.join(' '.join(item) for item in units.items())}"
        )
        lines = lines[1:]
    if not lines:
        raise DataRejected(f"{path}: the file has a header and no line of numbers")
    if comments:
        remarks.append(f"{len(comments)} lines of comments")
    return Layout(separator, tuple(names), lines, header, units, tuple(remarks))


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line without white space around them."""
    if separator == " ":
        if '"' not in line:
            return line.split()
        return [(quoted or plain).strip() for quoted, plain in _CELL.findall(line)]
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]


def trimmed(cells: list[str], n_column: int) -> list[str]:
    """Return the cells without an empty one behind the last column, which a separator at a line's end makes."""
    return cells[:-1] if len(cells) == n_column + 1 and not cells[-1] else cells


def _title(lines: Sequence[Line]) -> int:
    """Return how many lines stand above the names of the columns.

    Text with another number of cells than the table, or with empty ones, as spreadsheets fill up short lines.
    """
    for first in range(min(LONGEST_TITLE, len(lines) - 1)):
        separator = _separator(lines[first][1], [line for _, line in lines[first + 1 :][:LOOKED_AT]])
        names = _without_last_empty(split(lines[first][1], separator))
        if all(map(is_number, names)):
            return 0  # the table has begun
        if not all(map(_is_word, names)):
            continue
        below = [trimmed(split(line, separator), len(names)) for _, line in lines[first + 1 :][:2]]
        row = below[-1] if _units(below[0], len(names)) else below[0]
        if len(row) == len(names) and all(map(is_number, row)):
            above = [split(line, separator) for _, line in lines[:first]]
            alike = any(len(cells) == len(names) and all(cells) for cells in above)
            return 0 if alike or len(names) == 1 else first
    return 0


def _without_last_empty(cells: list[str]) -> list[str]:
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _separator(first: str, others: list[str]) -> str:
    """Return the separator that explains most lines; where none does, the one that is most frequent in the first."""
    best, chosen = (0, 0, 0), ""
    for separator in SEPARATORS:
        names = _without_last_empty(split(first, separator))
        rows = [trimmed(split(line, separator), len(names)) for line in others or [first]]
        alike = [row for row in rows if len(row) == len(names)]
        numeric = sum(
            all(not cell or (is_number(cell) and not (separator == "," and "," in cell)) for cell in row)
            for row in alike
        )
        merit = (numeric, len(alike), len(names))
        if separator == " " and any(
            cell.endswith((",", ";", "|")) for row in (names, *alike) for cell in row
        ):
            continue
        if len(names) > 1 and all(names) and alike and merit > best:
            best, chosen = merit, separator
    if chosen:
        return chosen
    frequent = max(SEPARATORS, key=lambda one: 0 if one == " " else first.count(one))
    return frequent if frequent in first else " "


def _is_word(cell: str) -> bool:
    return bool(cell) and not is_number(cell) and not foreign_notation(cell) and cell.lower() not in MISSING


def _is_header(path: Path, lines: Sequence[Line], separator: str) -> bool:
    """Tell whether the first line names the columns; DataRejected where it may be a line of data as well."""
    cells = split(lines[0][1], separator)
    words = [index for index, cell in enumerate(cells) if _is_word(cell)]
    if not words:
        return False
    if not any(is_number(cell) or foreign_notation(cell) for cell in cells):
        return True
    below = (split(line, separator) for _, line in lines[1:LOOKED_AT])
    row = next((row for row in below if len(row) >= len(cells) and any(map(is_number, row))), None)
    if row is None or any(is_number(row[index]) for index in words):
        return True
    raise DataRejected(
        f"{path}:{lines[0][0]}: '{cells[words[0]]}' is a word, and other cells of this first line are numbers: it may "
        "be names or data; name every column by a word in a line of its own"
    )


def _commented_names(comments: Sequence[Line], separator: str, n_column: int) -> list[str]:
    """Return the names in the last comment before the numbers, none where it is no list of so many words."""
    if not comments:
        return []
    text = comments[-1][1].lstrip()
    mark = next(mark for mark in COMMENTS if text.startswith(mark))
    cells = _without_last_empty(split(text.lstrip(mark[0]).strip(), separator))
    fits = len(cells) == n_column and all(_is_word(cell) and _NAME.fullmatch(cell) for cell in cells)
    return cells if fits else []


def _units(cells: list[str], n_column: int) -> list[str]:
    """Return the units in a line of words below the header, without brackets; none where it is no such line."""
    cells = trimmed(cells, n_column)
    if len(cells) != n_column or not any(is_unit(cell) for cell in cells if cell):
        return []
    if any(cell and not is_unit(cell) and cell != "-" and not _is_word(cell) for cell in cells):
        return []
    return ["" if cell == "-" else bare_unit(cell) for cell in cells]


def _check_names(path: Path, number: int, names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if "" in names:
        raise DataRejected(f"{path}:{number}: column {names.index('') + 1} has no name; give it one")
    if twice:
        raise DataRejected(f"{path}:{number}: two columns are called '{twice[0]}'; rename one")
