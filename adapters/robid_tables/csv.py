"""CSV and other delimited text as named columns.

The delimiter is found in the first line: comma, semicolon, tab, vertical bar, or white space. A first line of
words names the columns; without one they are called 1, 2, 3... A column of words (labels, dates) is left out;
one word in a column of numbers is an error with its line, never a hole. An empty cell is NaN.
"""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from robid_core import DataRejected, FloatArray

DELIMITERS = (",", ";", "\t", "|")


def read_columns(path: Path) -> tuple[dict[str, FloatArray], str, list[str]]:
    """Return the columns by name, the delimiter (" " for white space) and the names of columns of words.

    Raises
    ------
    DataRejected
        If the file is not UTF-8, is empty, or a line does not fit the first one; the message has the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataRejected(f"{path}: not UTF-8 text at byte {error.start}; save it as UTF-8") from error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines:
        raise DataRejected(f"{path}: the file is empty")
    first = lines[0][1].lstrip("#").strip()
    delimiter = max(DELIMITERS, key=first.count) if any(d in first for d in DELIMITERS) else " "
    header = _split(first, delimiter)
    if all(_number(cell) is not None for cell in header):
        names = [str(index + 1) for index in range(len(header))]
    else:
        names, lines = header, lines[1:]
    _check_names(path, names)
    lines = [(number, line) for number, line in lines if not line.startswith("#")]
    if not lines:
        raise DataRejected(f"{path}: the file has a header and no line of numbers")
    table = _read_fast(lines, delimiter, len(names))
    if table is not None:
        return {name: table[:, index].copy() for index, name in enumerate(names)}, delimiter, []
    return _read_slowly(path, lines, delimiter, names)


def _check_names(path: Path, names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DataRejected(f"{path}:1: two columns are called '{twice[0]}'; rename one")
    if "" in names:
        raise DataRejected(f"{path}:1: column {names.index('') + 1} has no name; give it one")


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _number(cell: str) -> float | None:
    if not cell:
        return math.nan
    try:
        return float(cell)
    except ValueError:
        return None


def _read_fast(lines: list[tuple[int, str]], delimiter: str, n_column: int) -> FloatArray | None:
    """Return (n_row, n_column) where every cell is a number; None where a careful look is needed."""
    text = io.StringIO("\n".join(line for _, line in lines))
    try:
        table: FloatArray = np.loadtxt(
            text, delimiter=None if delimiter == " " else delimiter, ndmin=2, comments=None, dtype=np.float64
        )
    except ValueError:
        return None
    return table if table.shape == (len(lines), n_column) else None


def _read_slowly(
    path: Path, lines: list[tuple[int, str]], delimiter: str, names: list[str]
) -> tuple[dict[str, FloatArray], str, list[str]]:
    rows = [(number, _split(line, delimiter)) for number, line in lines]
    for number, cells in rows:
        if len(cells) != len(names):
            raise DataRejected(
                f"{path}:{number}: {len(cells)} cells where the first line has {len(names)}; correct or remove the line"
            )
    columns: dict[str, FloatArray] = {}
    words: list[str] = []
    for index, name in enumerate(names):
        values = [_number(cells[index]) for _, cells in rows]
        wrong = [row for row, value in enumerate(values) if value is None]
        if len(wrong) == len(values):
            words.append(name)
            continue
        if wrong:
            number, cell = rows[wrong[0]][0], rows[wrong[0]][1][index]
            comma = (
                "; write decimal points, not commas" if _number(cell.replace(",", ".", 1)) is not None else ""
            )
            raise DataRejected(f"{path}:{number}: column '{name}' holds '{cell}', which is no number{comma}")
        columns[name] = np.array(values, dtype=np.float64)
    return columns, delimiter, words


class CsvRecords:
    """Reader of delimited text, registered as `csv` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line on the table and one for each column."""
        columns, delimiter, words = read_columns(path)
        n_row = len(next(iter(columns.values()), ()))
        title = {",": "comma", ";": "semicolon", "\t": "tab", "|": "vertical bar", " ": "white space"}[
            delimiter
        ]
        return [
            f"{n_row} rows, {len(columns)} columns of numbers, separated by {title}",
            *(f"{name}: ({n_row},) {_range(values)}" for name, values in columns.items()),
            *(f"{name}: words, left out" for name in words),
        ]

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the columns by name, each (n_row,)."""
        return read_columns(path)[0]


def _range(values: FloatArray) -> str:
    finite = values[np.isfinite(values)]
    return f"from {finite.min():g} to {finite.max():g}" if len(finite) else "no finite value"
