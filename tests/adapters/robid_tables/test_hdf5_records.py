"""HDF5: a record of robid comes back as it is, data sets of others by their paths."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from faults.fault import fault

from robid_core import Channel, DataRejected, DenseRun, Record
from robid_tables.hdf5 import Hdf5Records


def record() -> Record:
    position = np.random.default_rng(1).normal(size=(1, 1, 2, 1, 20, 1))
    run = DenseRun(
        sample_time_s=0.01,
        channels={"motor_position": Channel("motor", "rad", position)},
        time_s=np.arange(20) * 0.01,
        valid=np.ones(position.shape[:5], dtype=bool),
    )
    return Record(
        axis_names=("axis_1",), source="a test", torque_hold="continuous", runs=(run,), angle=np.zeros((1, 1))
    )


def test_a_record_of_robid_comes_back_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "record.h5"
    record().write(path)
    again = Hdf5Records.read_record(path)
    np.testing.assert_array_equal(
        again.runs[0].values("motor_position"), record().runs[0].values("motor_position")
    )
    lines = Hdf5Records.describe(path)
    assert lines[0] == "a record of robid: axes axis_1"
    assert "2 experiments x 1 periods x 20 samples, every 0.01 s: motor_position [rad]" in lines[1]


def test_data_sets_are_named_by_their_paths(tmp_path: Path) -> None:
    path = tmp_path / "plain.h5"
    table = np.zeros(4, dtype=[("t", "<f8"), ("label", "S3")])
    table["t"] = np.arange(4)
    with h5py.File(path, "w") as file:
        file["drive/position"] = np.arange(12.0).reshape(6, 2)
        file["rate"] = 1000
        file["note"] = "text"
        file["log"] = table
    columns = Hdf5Records.read(path)
    assert {name: values.shape for name, values in columns.items()} == {
        "drive/position": (6, 2),
        "rate": (),
        "log/t": (4,),
    }
    lines = Hdf5Records.describe(path)
    assert "rate: 1000" in lines
    assert "note: no real numbers, left out" in lines
    assert "log/label: no real numbers, left out" in lines
    with pytest.raises(DataRejected, match="no record of robid; give channels"):
        Hdf5Records.read_record(path)


@fault(
    "A02",
    sees="exit 5: the name of a data set is no text: damaged, or in another encoding; it was a mistake of the reader",
    mutant=(
        "adapters/robid_tables/hdf5.py",
        "        if isinstance(name, bytes):  #",
        "        if False:  #",
    ),
)
def test_a_name_that_is_no_text_is_told(tmp_path: Path) -> None:
    path = tmp_path / "names.h5"
    with h5py.File(path, "w") as file:
        file["position"] = np.zeros(3)
    content = path.read_bytes()
    assert content.count(b"position") == 1
    path.write_bytes(content.replace(b"position", b"posi\xfeion"))
    with pytest.raises(
        DataRejected, match=r"names.h5: cannot be read as HDF5 \(the name b'posi.xfeion' is no UTF-8"
    ):
        Hdf5Records.read(path)


def test_a_cut_file_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "cut.h5"
    with h5py.File(path, "w") as file:
        file["q"] = np.arange(1000.0)
    whole = path.read_bytes()
    for length in (0, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(DataRejected, match=r"cut\.h5: cannot be read as HDF5"):
            Hdf5Records.read(path)
