"""Delimited text becomes named columns, and a wrong line is told by its number."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from faults.fault import fault

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
        (
            b"q;tau\n1.5;2\n3;4,5\n",
            ":3: column 'tau' holds '4,5', which is no number of ours but a number with a dec",
        ),
        (b"q,q\n1,2\n", "two columns are called 'q'"),
        (b"q,,tau\n1,2,3\n", "column 2 has no name"),
        (b"q,tau\n", "no line of numbers"),
        (b"\n  \n", "empty"),
        (b"q,tau\n1,2\n3,4,5,6\n", "write decimal points, not commas"),
        (b"q,tau\n1,2\n3\n", "at the very end: the file looks cut"),
        (b"q,tau\n1,2\n3,1.5e-", "'1.5e-' is the beginning of a number: the file looks cut"),
        (b"q\0,\0t\0\n\0", "zero bytes"),
        (b"\xff\xfeq\0\n\0001", "the file looks cut"),
        (b"# only\n# comments\n", "nothing but comments"),
        (b"monday,1\ntuesday,2\n", ":1: 'monday' is a word, and other cells of this first line are numbers"),
        (b"when,where\nmonday,here\n", "no column holds numbers"),
    ],
)
def test_a_wrong_table_is_told_by_line_and_column(tmp_path: Path, text: bytes, told: str) -> None:
    with pytest.raises(DataRejected) as caught:
        CsvRecords.read(written(tmp_path, text))
    assert told in str(caught.value)
    assert "table.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "q;tau\n1,234;5,678\n",
            ":2: '1,234' may be 1.234 with a decimal comma or 1234 with thousands set apart",
        ),
        ("q;tau\n1,234;5.5\n", "may be 1.234 with a decimal comma or 1234 with thousands set apart"),
        ("1,5\n2,5\n", ":1: '1,5' may be whole numbers separated by commas, or numbers with decimal commas"),
        ("1,234\n", "may be whole numbers separated by commas"),
        ('q,tau\n"1,5",2.5\n', "a number with a decimal comma; write decimal points"),
        ('q,tau\n"1,234",2\n', "1.234 with a decimal comma or 1234"),
        ("q;tau\n1,234,567;2\n", "thousands set apart; write the digits"),
        ("q;tau\n1.234,5;2\n", "thousands set apart"),
        ("q;tau\n1'234.5;2\n", "thousands set apart"),
        ("q;tau\n1 234;2\n", "thousands set apart"),
        ("q;tau\n1_000;2\n", "thousands set apart"),
        ("q,tau\n5 Nm,2\n6 Nm,3\n", "a number with its unit"),
        ("q,tau\n12.5°,2\n", "a number with its unit"),
        ("q,tau\n1.5D+03,2\n", "exponent D"),
        ("q,tau\n\u22121.5,2\n", "typographic minus sign"),
        ("q,tau\nNA,2\n1,2\n", "leave the cell empty where nothing was measured"),
        ("NA,2.5\n1.5,2.5\n", "leave the cell empty"),
    ],
)
def test_a_number_in_another_notation_is_refused_and_never_taken_for_a_word(
    tmp_path: Path, text: str, told: str
) -> None:
    with pytest.raises(DataRejected) as caught:
        CsvRecords.read(written(tmp_path, text))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("q;tau\n1,5;2\n-0,25;,5\n", [[1.5, 2.0], [-0.25, 0.5]]),
        ("1,5\t2,5e-3\n3\t4\n", [[1.5, 2.5e-3], [3.0, 4.0]]),
        ("1,5 2,5\n3 4\n", [[1.5, 2.5], [3.0, 4.0]]),
        ("q;tau\n1,234;0,5\n", [[1.234, 0.5]]),
        ("position, rad;torque, Nm\n1,5;2\n", [[1.5, 2.0]]),
        ("q;tau\n1,5;\n", [[1.5, np.nan]]),
        ("1, 2\n3, 4\n", [[1.0, 2.0], [3.0, 4.0]]),
        ("1,-2\n3,4\n", [[1.0, -2.0], [3.0, 4.0]]),
        ("q, tau,\n1,2,\n3,4,\n", [[1.0, 2.0], [3.0, 4.0]]),
        ("q;tau\n1;2;\n3;4;\n", [[1.0, 2.0], [3.0, 4.0]]),
        ("1.5;2;\n3;4;\n", [[1.5, 2.0], [3.0, 4.0]]),
        ("% made by hand\n// on monday\nq tau\n1 2\n# a pause\n3 4\n", [[1.0, 2.0], [3.0, 4.0]]),
        ('"q";"tau"\n"1,5";"2"\n', [[1.5, 2.0]]),
        ("q   tau\n 1    2\n3  4   \n", [[1.0, 2.0], [3.0, 4.0]]),
        ("q\ttau [Nm]\n1\t 2\n", [[1.0, 2.0]]),
        ("q\n1,5\n2,25\n", [[1.5], [2.25]]),
    ],
)
def test_what_is_written_in_one_way_only_is_read(
    tmp_path: Path, text: str, expected: list[list[float]]
) -> None:
    columns = CsvRecords.read(written(tmp_path, text))
    np.testing.assert_array_equal(np.stack(list(columns.values()), axis=1), expected)


@pytest.mark.parametrize(
    ("encoding", "told"),
    [
        ("utf-8", "UTF-8"),
        ("utf-8-sig", "UTF-8 with byte order mark"),
        ("utf-16", "UTF-16"),
        ("cp1252", "Windows-1252"),
        ("latin-1", "Windows-1252"),
    ],
)
def test_the_encoding_is_found_from_the_bytes_and_told(tmp_path: Path, encoding: str, told: str) -> None:
    path = written(tmp_path, "Zeit;Winkel °\n0,5;1,5\n".encode(encoding))
    assert list(CsvRecords.read(path)) == ["Zeit", "Winkel °"]
    first = CsvRecords.describe(path)[0]
    assert first.endswith(f"separated by semicolon, with decimal commas, {told}")


def test_a_line_of_units_is_told_and_is_no_data(tmp_path: Path) -> None:
    path = written(tmp_path, "time,q,tau,note\n[s],rad,Nm,\n0.5,1,2,a\n1.0,3,4,b\n")
    assert CsvRecords.read(path)["q"].tolist() == [1.0, 3.0]
    assert CsvRecords.units(path) == {"time": "s", "q": "rad", "tau": "Nm"}
    assert "line 2 holds units: time s, q rad, tau Nm" in CsvRecords.describe(path)


def test_dates_that_are_no_clock_are_words_and_told(tmp_path: Path) -> None:
    path = written(tmp_path, "when,q\n2024-01-31,1\n2024-01-31,2\n")
    assert list(CsvRecords.read(path)) == ["q"]
    assert "when: dates or times of day that are no clock, left out" in CsvRecords.describe(path)


@fault(
    "A01",
    sees="`robid records` and the log of a run: line 3 has no end; if the recording was cut, its last number was too",
    mutant=(
        "adapters/robid_tables/csv.py",
        '    if not text.endswith("\\n"):\n        remarks',
        "    if not text:\n        remarks",
    ),
)
def test_a_last_line_without_end_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = written(tmp_path, "q,tau\n1,2.5\n3,4.2")
    assert any(line.startswith("A01: line 3 has no end") for line in CsvRecords.describe(path))
    with caplog.at_level(logging.WARNING, logger="robid.csv"):
        CsvRecords.read(path)
    assert "table.csv: A01: line 3 has no end" in caplog.text
    caplog.clear()
    CsvRecords.read(written(tmp_path, "q,tau\n1,2.5\n3,4.2\n"))
    assert caplog.text == ""


def test_a_big_table_with_decimal_commas_takes_the_fast_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*_: object) -> None:
        raise AssertionError("cell by cell")

    monkeypatch.setattr("robid_tables.csv._rows", slow)
    values = np.round(np.random.default_rng(2).normal(size=(2000, 3)), 6)
    lines = [";".join(f"{value:.6f}".replace(".", ",") for value in row) + ";" for row in values]
    columns = CsvRecords.read(written(tmp_path, "\n".join(["a;b;c;", *lines, ""])))
    np.testing.assert_array_equal(np.stack(list(columns.values()), axis=1), values)


@pytest.mark.parametrize(
    "title",
    [
        "Test bench 3;12.03.2024\n",
        "Test bench 3\nOperator;A. B.;hall 2;\n\n",
        "Test bench 3;;\n",
        "Test bench 3;;;\nOperator;A. B.;;\n",
    ],
)
@pytest.mark.parametrize("units", ["", "s;deg;A\n"])
def test_a_title_above_the_header_is_left_out_and_reported(tmp_path: Path, title: str, units: str) -> None:
    path = tmp_path / "bench.csv"
    path.write_text(f"{title}time;angle;current\n{units}0,0001;1,5;0,25\n0,0002;1,6;0,26\n", encoding="utf-8")
    columns = CsvRecords.read(path)
    assert list(columns) == ["time", "angle", "current"]
    assert columns["angle"].tolist() == [1.5, 1.6]
    assert any("above the names of the columns left out" in line for line in CsvRecords.describe(path))


def test_a_header_of_another_length_is_no_title(tmp_path: Path) -> None:
    """Two names above rows of three numbers: a name is missing, and no line below holds names."""
    path = tmp_path / "short.csv"
    path.write_text("time;angle\n0.1;1.5;0.25\n0.2;1.6;0.26\n", encoding="utf-8")
    with pytest.raises(DataRejected):
        CsvRecords.read(path)


def test_decimal_commas_in_quotes_are_read_where_commas_separate_cells(tmp_path: Path) -> None:
    """As spreadsheets of half of Europe export them; a cell without a fraction needs no quotes."""
    path = written(tmp_path, b'Zeit [s],"Winkel [deg]"\n"0,1","1,5"\n"0,2",-2\n')
    columns = CsvRecords.read(path)
    np.testing.assert_array_equal(columns["Zeit [s]"], [0.1, 0.2])
    np.testing.assert_array_equal(columns["Winkel [deg]"], [1.5, -2.0])
    assert "separated by comma, with decimal commas" in CsvRecords.describe(path)[0]
