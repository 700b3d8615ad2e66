"""MATLAB's version 7.3 reads as version 7 does; the files are written by the layout that MATLAB gives them.

A data set carries `MATLAB_class` and has its dimensions in reverse; structures are groups; elements of cells and of
arrays of structures lie in `#refs#`. One file that MATLAB itself wrote comes with scipy's tests.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from robid_core import DataRejected
from robid_tables.mat import MatRecords

CLASSES = {"float64": "double", "float32": "single", "bool": "logical"}
SCIPY_FILES = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"


class Writer:
    """Writes variables as MATLAB does: arrays, texts, dict (structure), list (array of structures), tuple (cells)."""

    def __init__(self, path: Path) -> None:
        self.file = h5py.File(path, "w", userblock_size=512)
        self.n_reference = 0

    def put(self, group: Any, name: str, value: Any) -> Any:
        if isinstance(value, dict):
            item = group.create_group(name)
            item.attrs["MATLAB_class"] = np.bytes_("struct")
            for field, inner in value.items():
                self.put(item, field, inner)
        elif isinstance(value, list):
            item = group.create_group(name)
            item.attrs["MATLAB_class"] = np.bytes_("struct")
            for field in value[0]:
                self._references(item, field, [entry[field] for entry in value])
        elif isinstance(value, tuple):
            item = self._references(group, name, list(value))
            item.attrs["MATLAB_class"] = np.bytes_("cell")
        elif isinstance(value, str):
            codes = np.array([[ord(letter)] for letter in value], dtype=np.uint16)
            item = group.create_dataset(name, data=codes)
            item.attrs["MATLAB_class"] = np.bytes_("char")
            item.attrs["MATLAB_int_decode"] = np.int32(2)
        else:
            item = self._array(group, name, np.atleast_2d(value))
        return item

    def _array(self, group: Any, name: str, values: np.ndarray) -> Any:
        if not values.size:
            item = group.create_dataset(name, data=np.array(values.shape, dtype=np.uint64))
            item.attrs["MATLAB_empty"] = np.uint8(1)
        elif values.dtype.kind == "c":
            pair = np.zeros(values.T.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
            pair["real"], pair["imag"] = values.T.real, values.T.imag
            item = group.create_dataset(name, data=pair)
        else:
            item = group.create_dataset(
                name, data=values.T.astype(np.uint8) if values.dtype == bool else values.T
            )
        kind = "double" if values.dtype.kind == "c" else CLASSES.get(values.dtype.name, values.dtype.name)
        item.attrs["MATLAB_class"] = np.bytes_(kind)
        return item

    def _references(self, group: Any, name: str, values: list[Any]) -> Any:
        store = self.file.require_group("#refs#")
        found = []
        for value in values:
            self.n_reference += 1
            found.append([self.put(store, f"r{self.n_reference}", value).ref])
        return group.create_dataset(name, data=np.array(found, dtype=h5py.ref_dtype))


def written(path: Path, content: dict[str, Any]) -> Path:
    writer = Writer(path)
    with writer.file:
        for name, value in content.items():
            writer.put(writer.file, name, value)
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as file:
        file.write(header)
    return path


def older(path: Path, content: dict[str, Any]) -> Path:
    def plain(value: Any) -> Any:
        if isinstance(value, list):
            entries = np.zeros((1, len(value)), dtype=[(field, "O") for field in value[0]])
            for index, entry in enumerate(value):
                for field, inner in entry.items():
                    entries[field][0, index] = plain(inner)
            return entries
        if isinstance(value, tuple):
            cells = np.empty((1, len(value)), dtype=object)
            for index, inner in enumerate(value):
                cells[0, index] = plain(inner)
            return cells
        return {field: plain(inner) for field, inner in value.items()} if isinstance(value, dict) else value

    scipy.io.savemat(path, plain(content))
    return path


def same(folder: Path, content: dict[str, Any]) -> dict[str, np.ndarray]:
    """Read both versions, hold them against each other, and return the columns."""
    new, old = written(folder / "new.mat", content), older(folder / "old.mat", content)
    one, other = MatRecords.read(new), MatRecords.read(old)
    assert set(one) == set(other)
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name])
        assert values.dtype == np.float64
    assert sorted(MatRecords.describe(new)) == sorted(MatRecords.describe(old))
    return one


def test_both_versions_of_a_recording_read_the_same(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    columns = same(
        tmp_path,
        {
            "t": np.arange(50.0)[:, None] * 1e-3,
            "q": random.normal(size=(6, 50)),
            "cube": random.normal(size=(2, 3, 4)),
            "gain": np.array([[2.5]]),
            "counts": np.arange(5, dtype=np.int16),
            "on": np.array([True, False, True]),
            "robot": "six axes",
            "joints": ("shoulder", "elbow"),
            "rec": {"drive": {"torque": random.normal(size=(50, 6))}, "note": "text"},
            "runs": [{"x": np.arange(3.0), "label": "a"}, {"x": np.arange(4.0), "label": "b"}],
            "parts": (np.arange(3.0), {"y": np.ones((5, 2))}),
            "z": np.array([[1 + 2j, 3.0]]),
            "none": np.zeros((0, 3)),
        },
    )
    assert columns["q"].shape == (6, 50)
    assert columns["cube"].shape == (2, 3, 4)
    assert columns["gain"].shape == ()
    assert columns["runs(2).x"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert columns["parts{2}.y"].shape == (5, 2)


@settings(max_examples=40, deadline=None)
@given(
    values=arrays(
        st.sampled_from([np.float64, np.float32, np.int32, np.uint8, np.bool_]),
        array_shapes(min_dims=2, max_dims=4, max_side=5),
    )
)
def test_no_array_is_transposed_by_the_version(
    tmp_path_factory: pytest.TempPathFactory, values: np.ndarray
) -> None:
    values = np.nan_to_num(values)
    columns = same(tmp_path_factory.getbasetemp(), {"x": values})
    np.testing.assert_array_equal(columns["x"], np.squeeze(values))


def test_a_file_that_matlab_wrote_reads_as_its_older_twin() -> None:
    new, old = SCIPY_FILES / "testhdf5_7.4_GLNX86.mat", SCIPY_FILES / "testdouble_7.4_GLNX86.mat"
    if not new.is_file():
        pytest.skip("scipy is installed without its tests' data")
    one, other = MatRecords.read(new), MatRecords.read(old)
    assert set(one) == set(other) == {"testdouble"}
    np.testing.assert_allclose(one["testdouble"], other["testdouble"], rtol=1e-15)
    np.testing.assert_allclose(one["testdouble"], np.arange(9) * np.pi / 4, rtol=1e-15)


def test_a_cut_file_is_rejected(tmp_path: Path) -> None:
    path = written(tmp_path / "whole.mat", {"q": np.arange(1000.0), "s": [{"x": 1.0}, {"x": 2.0}]})
    whole = path.read_bytes()
    for length in range(600, len(whole) - 1, 997):
        path.write_bytes(whole[:length])
        with pytest.raises(DataRejected, match=r"whole\.mat: cannot be read as a MATLAB file"):
            MatRecords.read(path)


def test_cells_that_refer_to_themselves_are_rejected(tmp_path: Path) -> None:
    path = written(tmp_path / "loop.mat", {"a": (np.arange(3.0),)})
    with h5py.File(path, "r+") as file:
        file["a"][0, 0] = file["a"].ref
    with pytest.raises(DataRejected, match="refer to one another"):
        MatRecords.read(path)
