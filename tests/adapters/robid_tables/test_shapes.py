"""Shapes that readers tell without reading numbers are those of what they read."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from robid_core import DataRejected
from robid_tables.csv import CsvRecords
from robid_tables.hdf5 import Hdf5Records
from robid_tables.npz import NpzRecords


def test_an_archive_tells_its_members(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    np.savez(path, q=np.arange(4), tau=np.zeros((4, 6)), rate=np.float64(1e3), label=np.array(["a", "b"]))
    shapes = NpzRecords.shapes(path)
    assert shapes == {"q": (4,), "tau": (4, 6), "rate": ()}
    assert shapes == {name: values.shape for name, values in NpzRecords.read(path).items()}
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(DataRejected, match="no intact NumPy archive"):
        NpzRecords.shapes(path)


def test_hdf5_tells_its_data_sets_and_fields(tmp_path: Path) -> None:
    path = tmp_path / "plain.h5"
    with h5py.File(path, "w") as file:
        file["drive/position"] = np.arange(12.0).reshape(6, 2)
        file["rate"] = 1000
        file["note"] = "text"
        file["empty"] = np.zeros(0)
        file["log"] = np.zeros(4, dtype=[("t", "<f8"), ("q", "<f4", (3,)), ("label", "S3")])
    shapes = Hdf5Records.shapes(path)
    assert shapes == {"drive/position": (6, 2), "rate": (), "log/t": (4,), "log/q": (4, 3)}
    assert shapes == {name: values.shape for name, values in Hdf5Records.read(path).items()}


@pytest.mark.parametrize("text", ["t,q\n1,2\n3,4\n5,6\n", "1;2\n3;4\n5;6\n", "t q\ns rad\n1 2\n3 4\n5 6"])
def test_a_delimited_text_tells_header_and_lines(tmp_path: Path, text: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    assert CsvRecords.shapes(path) == {name: values.shape for name, values in CsvRecords.read(path).items()}


def test_a_very_long_text_is_not_read_for_its_shape(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    with path.open("wb") as file:
        file.truncate(200_000_000)  # a hole, which takes no room
    assert CsvRecords.shapes(path) == {}
