"""Parquet files become named columns; what is absent is NaN, and told."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyarrow")

import pyarrow
import pyarrow.parquet

from robid_core import DataRejected
from robid_parquet.records import ParquetRecords


def written(folder: Path, table: pyarrow.Table) -> Path:
    path = folder / "run.parquet"
    pyarrow.parquet.write_table(table, path, row_group_size=2)
    return path


def test_numbers_of_all_kinds_come_back_and_texts_are_told(tmp_path: Path) -> None:
    table = pyarrow.table(
        {
            "q": np.array([1.5, -2.0, 3.25]),
            "count": np.array([1, 2, 3], dtype=np.int16),
            "on": [True, False, True],
            "label": ["a", "b", "c"],
            "motor": [{"temp": 20.5, "name": "x"}, {"temp": 21.0, "name": "x"}, {"temp": 22.0, "name": "x"}],
            "joints": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]],
            "ragged": [[1.0], [2.0, 3.0], []],
        }
    )
    path = written(tmp_path, table)
    columns = ParquetRecords.read(path)
    assert {name: values.tolist() for name, values in columns.items()} == {
        "q": [1.5, -2.0, 3.25],
        "count": [1.0, 2.0, 3.0],
        "on": [1.0, 0.0, 1.0],
        "motor.temp": [20.5, 21.0, 22.0],
        "joints": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]],
    }
    lines = ParquetRecords.describe(path)
    assert "label: string, left out" in lines
    assert any(line.startswith("ragged:") and "different lengths" in line for line in lines)


def test_an_absent_value_is_not_a_number_and_told(tmp_path: Path) -> None:
    path = written(
        tmp_path, pyarrow.table({"q": [1.0, None, 3.0], "n": pyarrow.array([None, 2, 3], pyarrow.int32())})
    )
    columns = ParquetRecords.read(path)
    np.testing.assert_array_equal(columns["q"], [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(columns["n"], [np.nan, 2.0, 3.0])
    assert "q: absent in 1 of 3 rows, NaN there" in ParquetRecords.describe(path)


def test_instants_are_seconds(tmp_path: Path) -> None:
    start = datetime.datetime(2024, 1, 31, 10, 0, 0)
    stamps = pyarrow.array(
        [start + datetime.timedelta(milliseconds=5 * i) for i in range(4)], pyarrow.timestamp("us")
    )
    path = written(tmp_path, pyarrow.table({"t": stamps, "q": np.arange(4.0)}))
    # Seconds since 1970 as float64 are 2.4e-7 s apart.
    np.testing.assert_allclose(np.diff(ParquetRecords.read(path)["t"]), 0.005, atol=5e-7)
    expected = start.replace(tzinfo=datetime.UTC).timestamp()
    assert ParquetRecords.read(path)["t"][0] == pytest.approx(expected, abs=1e-6)
    assert "t: timestamp[us], read in seconds" in ParquetRecords.describe(path)


def test_a_cut_file_is_rejected(tmp_path: Path) -> None:
    path = written(tmp_path, pyarrow.table({"q": np.arange(1000.0)}))
    whole = path.read_bytes()
    for length in (0, 3, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(DataRejected, match=r"run\.parquet: cannot be read as Parquet"):
            ParquetRecords.read(path)


def test_a_page_must_fit_its_checksum(tmp_path: Path) -> None:
    path, values = tmp_path / "run.parquet", np.random.default_rng(5).normal(size=1000)
    pyarrow.parquet.write_table(
        pyarrow.table({"q": values}),
        path,
        compression="none",
        use_dictionary=False,
        write_page_checksum=True,
    )
    whole = path.read_bytes()
    place = whole.index(values[500].tobytes())
    path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    with pytest.raises(DataRejected, match=r"run\.parquet: cannot be read as Parquet"):
        ParquetRecords.read(path)


def test_shapes_are_told_by_the_footer(tmp_path: Path) -> None:
    path = written(tmp_path, pyarrow.table({"q": [1.0, None, 3.0], "n": [1, 2, 3]}))
    assert ParquetRecords.shapes(path) == {
        name: values.shape for name, values in ParquetRecords.read(path).items()
    }
    assert ParquetRecords.shapes(written(tmp_path, pyarrow.table({"q": [[1.0, 2.0], [3.0, 4.0]]}))) == {}
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(DataRejected, match="cannot be read as Parquet"):
        ParquetRecords.shapes(path)
