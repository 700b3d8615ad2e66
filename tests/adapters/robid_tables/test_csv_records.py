"""Delimited text becomes named columns, and a wrong line is told by its number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robid_core import DataRejected
from robid_tables.csv import CsvRecords


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " "])
def test_columns_come_back_by_name_whatever_separates_them(tmp_path: Path, delimiter: str) -> None:
    values = np.random.default_rng(1).normal(size=(50, 3))
    lines = [
        delimiter.join(["time", "q", "tau"]),
        *(delimiter.join(map(repr, row)) for row in values.tolist()),
    ]
    columns = CsvRecords.read(written(tmp_path, "\n".join(lines)))
    assert list(columns) == ["time", "q", "tau"]
    for index, name in enumerate(columns):
        np.testing.assert_array_equal(columns[name], values[:, index])


def test_a_table_without_header_is_numbered_from_one(tmp_path: Path) -> None:
    columns = CsvRecords.read(written(tmp_path, "  1.5e+00\t -2\n   3\t 4\n"))
    assert {name: column.tolist() for name, column in columns.items()} == {"1": [1.5, 3.0], "2": [-2.0, 4.0]}


def test_byte_order_mark_quotes_comments_and_empty_lines_are_no_data(tmp_path: Path) -> None:
    columns = CsvRecords.read(
        written(tmp_path, b'\xef\xbb\xbf"q, motor",tau\r\n# a note\r\n1,2\r\n\r\n3,4\r\n')
    )
    assert columns["q, motor"].tolist() == [1.0, 3.0]
    assert columns["tau"].tolist() == [2.0, 4.0]


def test_a_header_behind_a_hash_names_the_columns(tmp_path: Path) -> None:
    assert list(CsvRecords.read(written(tmp_path, "# q tau\n1 2\n"))) == ["q", "tau"]


def test_an_empty_cell_is_not_a_number_and_never_zero(tmp_path: Path) -> None:
    columns = CsvRecords.read(written(tmp_path, "q,tau\n1,2\n,4\n"))
    np.testing.assert_array_equal(columns["q"], [1.0, np.nan])


def test_a_column_of_words_is_left_out_and_told(tmp_path: Path) -> None:
    path = written(tmp_path, "when,q\nmonday,1\ntuesday,2\n")
    assert list(CsvRecords.read(path)) == ["q"]
    assert any("when" in line and "words" in line for line in CsvRecords.describe(path))


def test_the_description_tells_rows_columns_and_ranges(tmp_path: Path) -> None:
    lines = CsvRecords.describe(written(tmp_path, "q;tau\n1;2\n3;-4\n"))
    assert "2 rows" in lines[0]
    assert "semicolon" in lines[0]
    assert lines[2] == "tau: (2,) from -4 to 2"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b"q,tau\n1,2\n3\n", ":3: 1 cells"),
        (b"q,tau\n1,2\n3,4,5\n", ":3: 3 cells"),
        (b"q,tau\n1,2\n\n3,four\n", ":4: column 'tau' holds 'four'"),
        (b"q;tau\n1;2\n3;4,5\n", ":3: column 'tau' holds '4,5', which is no number; write decimal points"),
        (b"q,q\n1,2\n", "two columns are called 'q'"),
        (b"q,,tau\n1,2,3\n", "column 2 has no name"),
        (b"q,tau\n", "no line of numbers"),
        (b"\n  \n", "empty"),
        (b"q,t\xb0\n1,2\n", "not UTF-8 text at byte 3"),
    ],
)
def test_a_wrong_table_is_told_by_line_and_column(tmp_path: Path, text: bytes, told: str) -> None:
    with pytest.raises(DataRejected) as caught:
        CsvRecords.read(written(tmp_path, text))
    assert told in str(caught.value)
    assert "table.csv" in str(caught.value)
