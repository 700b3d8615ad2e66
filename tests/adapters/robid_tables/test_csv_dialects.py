"""A table written in any dialect reads back equal, or is refused with a sentence: never other numbers of that shape."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from robid_core import DataRejected
from robid_tables.csv import CsvRecords

NAMES = ["time", "q", "tau", "Winkel"]
UNITS = ["[s]", "rad", "Nm", "[°]"]


@dataclass(frozen=True)
class Dialect:
    separator: str
    mark: str
    encoding: str
    header: bool
    unit_line: bool
    trailing: bool
    quoted: bool
    comment: str
    end: str
    precision: str


DIALECTS = st.builds(
    Dialect,
    separator=st.sampled_from([",", ";", "\t", "|", " ", "   ", ", ", "; "]),
    mark=st.sampled_from([".", ","]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    header=st.booleans(),
    unit_line=st.booleans(),
    trailing=st.booleans(),
    quoted=st.booleans(),
    comment=st.sampled_from(["", "#", "%", "//"]),
    end=st.sampled_from(["\n", "\r\n"]),
    precision=st.sampled_from(["r", ".3f", ".1f", "g", ".2e"]),
)
NUMBERS = st.one_of(
    st.integers(-2000, 2000).map(float),
    st.floats(-1e4, 1e4).map(lambda value: round(value, 3)),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
)
TABLES = st.integers(1, 4).flatmap(
    lambda n_column: st.lists(st.lists(NUMBERS, min_size=n_column, max_size=n_column), min_size=1, max_size=6)
)


def cells_of(row: list[float], dialect: Dialect) -> list[str]:
    texts = [repr(value) if dialect.precision == "r" else format(value, dialect.precision) for value in row]
    return [text.replace(".", dialect.mark) for text in texts]


def text_of(rows: list[list[float]], dialect: Dialect) -> tuple[str, list[list[float]]]:
    """Return the text, and the numbers that its cells mean."""
    n_column = len(rows[0])
    cells = [cells_of(row, dialect) for row in rows]
    meant = [[float(cell.replace(dialect.mark, ".")) for cell in row] for row in cells]
    lines = (
        [NAMES[:n_column]] * dialect.header
        + [UNITS[:n_column]] * (dialect.header and dialect.unit_line)
        + cells
    )
    if dialect.quoted:
        lines = [[f'"{cell}"' for cell in line] for line in lines]
    end = dialect.separator.strip(" ") if dialect.trailing else ""
    joined = [dialect.separator.join(line) + end for line in lines]
    if dialect.comment:
        joined.insert(0, f"{dialect.comment} 2024-01-31; a robot, in the laboratory; made by hand")
        joined.insert(len(joined) - 1, f"{dialect.comment} a pause")
    return dialect.end.join([*joined, ""]), meant


@settings(max_examples=400, deadline=None)
@given(rows=TABLES, dialect=DIALECTS)
@example([[0.0, 1.5], [0.0, -1.0]], Dialect(",", ",", "utf-8", False, False, True, False, "", "\n", "g"))
def test_a_table_in_any_dialect_reads_back_equal_or_is_refused(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[float]], dialect: Dialect
) -> None:
    text, meant = text_of(rows, dialect)
    path = tmp_path_factory.getbasetemp() / "dialect.csv"
    path.write_bytes(text.encode(dialect.encoding))
    try:
        columns = CsvRecords.read(path)
    except DataRejected:
        return
    table = np.stack(list(columns.values()), axis=1)
    np.testing.assert_array_equal(table, meant)
    if dialect.header:
        assert list(columns) == NAMES[: len(rows[0])]


@settings(max_examples=150, deadline=None)
@given(
    rows=TABLES,
    separator=st.sampled_from([",", ";", "\t", "|"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    trailing=st.booleans(),
    unit_line=st.booleans(),
)
def test_a_table_with_a_header_and_decimal_points_is_never_refused(
    tmp_path_factory: pytest.TempPathFactory,
    rows: list[list[float]],
    separator: str,
    encoding: str,
    trailing: bool,
    unit_line: bool,
) -> None:
    dialect = Dialect(separator, ".", encoding, True, unit_line, trailing, False, "#", "\n", "r")
    text, meant = text_of(rows, dialect)
    path = tmp_path_factory.getbasetemp() / "plain.csv"
    path.write_bytes(text.encode(encoding))
    columns = CsvRecords.read(path)
    np.testing.assert_array_equal(np.stack(list(columns.values()), axis=1), meant)


@settings(max_examples=150, deadline=None)
@given(rows=TABLES, separator=st.sampled_from([";", "\t", "|", " ", ","]), header=st.booleans())
@example([[0.1, 1.5]], ",", True)
@example([[0.1, 1.5], [2.0, 3.0]], ",", False)
def test_decimal_commas_are_refused_only_where_thousands_may_be_meant(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[float]], separator: str, header: bool
) -> None:
    quoted = separator == ","  # else nobody can tell the two kinds of commas apart
    dialect = Dialect(separator, ",", "utf-8", header, False, False, quoted, "", "\n", "r")
    text, meant = text_of(rows, dialect)
    path = tmp_path_factory.getbasetemp() / "commas.csv"
    path.write_text(text)
    cells = [cell for row in rows for cell in cells_of(row, dialect) if "," in cell]

    def two_meanings(cell: str) -> bool:
        whole, fraction = cell.lstrip("-").split(",")
        return len(fraction) == 3 and fraction.isdigit() and len(whole) <= 3 and whole != "0"

    alone = len(rows[0]) == 1 and not header and not quoted  # 1,5 in every line may be two columns
    if cells and (alone or all(two_meanings(cell) for cell in cells)):
        with pytest.raises(DataRejected, match="may be"):
            CsvRecords.read(path)
        return
    columns = CsvRecords.read(path)
    assert not any(math.isnan(value) for values in columns.values() for value in values)
    np.testing.assert_array_equal(np.stack(list(columns.values()), axis=1), meant)
