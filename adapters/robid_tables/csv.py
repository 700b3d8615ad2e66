"""CSV and other delimited text as named columns.

Encoding, separator (comma, semicolon, tab, vertical bar, white space) and decimal mark are found in the file. A first
line of words names the columns; without one they are called 1, 2, 3... Dates with times of day become seconds. A column
of words is left out; one word in a column of numbers is an error with its line, never a hole, and so is a number that
can be read in two ways. An empty cell is NaN.
"""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robid_core import DataRejected, FloatArray
from robid_tables.encoding import read_text
from robid_tables.instants import TOLD, instants
from robid_tables.layout import SEPARATORS, Layout, Line, layout_of, split, trimmed
from robid_tables.notation import (
    CERTAIN_COMMA,
    DECIMAL_COMMA,
    MISSING,
    NUMBER,
    TWO_MEANINGS,
    foreign_notation,
    is_date,
    number,
)

_log = logging.getLogger("robid.csv")
LONG = 100_000_000  # bytes; lines of as many are counted in half a second
CUT = "A01"  # begins what is told of a cut file
_INTEGER = re.compile("[+-]?[0-9]+")
_FRACTION = re.compile("[0-9]+(?:e[+-]?[0-9]+)?", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """Columns of numbers by name, each (n_row,); what other columns are; and how all that is written."""

    columns: dict[str, FloatArray]
    words: dict[str, str]
    layout: Layout
    mark: str
    encoding: str
    remarks: tuple[str, ...]


def read_table(path: Path) -> Table:
    """Return what a delimited text holds.

    Raises
    ------
    DataRejected
        If the file is empty, a line does not fit the first one, or a number can be read in two ways; the message has
        the line.
    """
    text, encoding = read_text(path)
    layout = layout_of(path, text)
    remarks = layout.remarks
    if not text.endswith("\n"):
        remarks += (
            f"{CUT}: line {layout.body[-1][0]} has no end: if the recording was cut, its last number was too; remove "
            "the line, or end it where it is whole",
        )
    if not layout.header and layout.separator == ",":
        _refuse_two_meanings(path, layout.body)
    mark, table = _read_fast(layout)
    if table is not None:
        columns = {name: table[:, index].copy() for index, name in enumerate(layout.names)}
        return Table(columns, {}, layout, mark, encoding, remarks)
    rows = _rows(path, layout, complete=text.endswith("\n"))
    mark = _decimal_mark(path, rows)
    columns, words, clocks = _read_slowly(path, layout, rows, mark)
    remarks += tuple(f"{name}: {TOLD}" for name in clocks)
    return Table(columns, words, layout, mark, encoding, remarks)


def _refuse_two_meanings(path: Path, body: Sequence[Line]) -> None:
    """Refuse lines such as `1,5` without a header, if all are so: two whole numbers, or one with a decimal comma."""
    for _, line in body:
        if "." in line or '"' in line:
            return
        cells = line.strip().split(",")
        pairs = itertools.pairwise(cells)
        if not any(
            _INTEGER.fullmatch(one.lstrip()) and _FRACTION.fullmatch(other.rstrip()) for one, other in pairs
        ):
            return
    first, line = body[0]
    raise DataRejected(
        f"{path}:{first}: '{line.strip()}' may be whole numbers separated by commas, or numbers with decimal commas; "
        "name the columns in a first line, or write decimal points"
    )


def _read_fast(layout: Layout) -> tuple[str, FloatArray | None]:
    """Return the decimal mark and (n_row, n_column) where all cells are numbers; None where cells need a look."""
    separator, mark, lines = layout.separator, ".", [line for _, line in layout.body]
    if separator != " " and lines[0].rstrip(" ").endswith(separator):
        if not all(line.rstrip(" ").endswith(separator) for line in lines):
            return mark, None
        lines = [line.rstrip(" ")[:-1] for line in lines]
    if separator != ",":
        joined = "\n".join(lines)
        if "," in joined:
            if "." in joined or not CERTAIN_COMMA.search(joined):
                return mark, None
            mark, lines = ",", joined.replace(",", ".").split("\n")
    try:
        table: FloatArray = np.loadtxt(
            lines, delimiter=None if separator == " " else separator, ndmin=2, comments=None, dtype=np.float64
        )
    except ValueError:
        return mark, None
    return mark, table if table.shape == (len(lines), len(layout.names)) else None


def _rows(path: Path, layout: Layout, complete: bool) -> list[tuple[int, list[str]]]:
    """Return the number and the cells of each line; DataRejected where a line has more or fewer than the first one."""
    n_column = len(layout.names)
    rows = [(line, trimmed(split(text, layout.separator), n_column)) for line, text in layout.body]
    for line, cells in rows:
        if len(cells) == n_column:
            continue
        told = f"{path}:{line}: {len(cells)} cells where the first line has {n_column}"
        if len(cells) < n_column and line == rows[-1][0] and len(rows) > 1:
            raise DataRejected(
                f"A01: {told}, at the very end: the file looks cut; remove the line or copy it again"
            )
        comma = layout.separator == "," and len(cells) > n_column
        hint = ", and write decimal points, not commas, where commas separate the cells" if comma else ""
        raise DataRejected(f"{told}; correct or remove the line{hint}")
    last, cells = rows[-1]
    cut = next((cell for cell in cells if number(cell) is None and number(cell + "0") is not None), None)
    if cut is not None and not complete:
        raise DataRejected(
            f"A01: {path}:{last}: '{cut}' is the beginning of a number: the file looks cut; remove the line"
        )
    return rows


def _decimal_mark(path: Path, rows: list[tuple[int, list[str]]]) -> str:
    """Return the decimal mark; DataRejected where commas may also set thousands apart.

    Where commas separate the cells, one within a cell stands in quotes.
    """
    commas = [
        (line, cell)
        for line, cells in rows
        for cell in cells
        if "," in cell and DECIMAL_COMMA.fullmatch(cell)
    ]
    if not commas or any("." in cell and NUMBER.fullmatch(cell) for _, cells in rows for cell in cells):
        return "."
    if all(TWO_MEANINGS.fullmatch(cell) for _, cell in commas):
        line, cell = commas[0]
        raise DataRejected(f"{path}:{line}: '{cell}' may be {foreign_notation(cell)}")
    return ","


def _read_slowly(
    path: Path, layout: Layout, rows: list[tuple[int, list[str]]], mark: str
) -> tuple[dict[str, FloatArray], dict[str, str], list[str]]:
    """Return the columns of numbers, for each other one what its words are, and which columns were instants."""
    columns: dict[str, FloatArray] = {}
    words: dict[str, str] = {}
    clocks: list[str] = []
    for index, name in enumerate(layout.names):
        values = [number(cells[index], mark) for _, cells in rows]
        wrong = [row for row, value in enumerate(values) if value is None]
        if not wrong:
            columns[name] = np.array(values, dtype=np.float64)
            continue
        foreign = next((row for row in wrong if foreign_notation(rows[row][1][index])), None)
        filled = sum(bool(cells[index]) for _, cells in rows)
        if foreign is None and len(wrong) == filled:
            seconds = instants([cells[index] for _, cells in rows])
            if seconds is not None:
                columns[name] = seconds
                clocks.append(name)
                continue
            dates = all(is_date(rows[row][1][index]) for row in wrong)
            words[name] = "dates or times of day that are no clock" if dates else "words"
            continue
        line, cells = rows[wrong[0] if foreign is None else foreign]
        raise DataRejected(
            f"{path}:{line}: column '{name}' holds '{cells[index]}', which is {_complaint(cells[index])}"
        )
    if not columns:
        raise DataRejected(f"{path}: no column holds numbers")
    return columns, words, clocks


def _complaint(cell: str) -> str:
    """Say why a cell is no number, and what to do."""
    foreign = foreign_notation(cell)
    if foreign:
        return (
            f"no number of ours but {foreign}"
            if not TWO_MEANINGS.fullmatch(cell)
            else f"no number: it may be {foreign}"
        )
    if cell.lower() in MISSING:
        return "no number; leave the cell empty where nothing was measured"
    return "no number"


class CsvRecords:
    """Reader of delimited text, registered as `csv` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line on the table, one for each column, and what else there is to say."""
        table = read_table(path)
        n_row = len(next(iter(table.columns.values()), ()))
        title = SEPARATORS[table.layout.separator]
        comma = ", with decimal commas" if table.mark == "," else ""
        return [
            f"{n_row} rows, {len(table.columns)} columns of numbers, separated by {title}{comma}, {table.encoding}",
            *(f"{name}: ({n_row},) {_range(values)}" for name, values in table.columns.items()),
            *(f"{name}: {what}, left out" for name, what in table.words.items()),
            *table.remarks,
        ]

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the columns by name, each (n_row,); a last line that may be cut is logged."""
        table = read_table(path)
        for remark in table.remarks:
            if remark.startswith(CUT):
                _log.warning("%s: %s", path, remark)
        return table.columns

    @staticmethod
    def shapes(path: Path) -> dict[str, tuple[int, ...]]:
        """Return the shape of each column, of words too, by the header and the count of lines; of a long file none."""
        if path.stat().st_size > LONG:
            return {}
        layout = layout_of(path, read_text(path)[0])
        return dict.fromkeys(layout.names, (len(layout.body),))

    @staticmethod
    def units(path: Path) -> dict[str, str]:
        """Return the units that a line below the header states, by column."""
        return layout_of(path, read_text(path)[0]).units


def _range(values: FloatArray) -> str:
    finite = values[np.isfinite(values)]
    return f"from {finite.min():g} to {finite.max():g}" if len(finite) else "no finite value"
