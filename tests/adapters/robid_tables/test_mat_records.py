"""MATLAB files become named arrays, structures flattened; damage never escapes as a traceback of scipy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from faults.fault import fault

from robid_core import DataRejected
from robid_tables.mat import MatRecords
from robid_tables.matlab_elements import check_elements


def saved(folder: Path) -> Path:
    path = folder / "recording.mat"
    content = {
        "q": np.arange(6.0).reshape(6, 1),
        "gain": 2.5,
        "counts": np.array([1, 2, 3], dtype=np.int16),
        "name": "a robot",
        "rec": {"position": np.ones((6, 4)), "drive": {"torque": np.zeros(5)}, "note": "text"},
    }
    scipy.io.savemat(path, content, do_compression=True)
    return path


def message_of(path: Path) -> str:
    try:
        MatRecords.read(path)
    except DataRejected as error:
        return str(error)
    return ""


def test_structures_are_flattened_and_text_is_left_out(tmp_path: Path) -> None:
    columns = MatRecords.read(saved(tmp_path))
    assert {name: values.shape for name, values in columns.items()} == {
        "q": (6,),
        "gain": (),
        "counts": (3,),
        "rec.position": (6, 4),
        "rec.drive.torque": (5,),
    }
    assert all(values.dtype == np.float64 for values in columns.values())
    np.testing.assert_array_equal(columns["counts"], [1.0, 2.0, 3.0])


def test_the_elements_of_a_structure_array_are_numbered_as_matlab_does(tmp_path: Path) -> None:
    path = tmp_path / "array.mat"
    entries = np.zeros(2, dtype=[("x", "O")])
    entries["x"] = [np.arange(3.0), np.arange(4.0)]
    scipy.io.savemat(path, {"s": entries})
    assert set(MatRecords.read(path)) == {"s(1).x", "s(2).x"}


def test_the_description_tells_shapes_and_single_values(tmp_path: Path) -> None:
    lines = MatRecords.describe(saved(tmp_path))
    assert "gain: 2.5" in lines
    assert "rec.position: (6, 4)" in lines


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    path = tmp_path / "texts.mat"
    cells = np.array(["shoulder", "elbow"], dtype=object)
    scipy.io.savemat(
        path, {"q": np.arange(3.0), "joints": cells, "z": np.array([1j, 2.0]), "none": np.zeros((0, 3))}
    )
    lines = MatRecords.describe(path)
    assert lines == [
        "q: (3,)",
        "joints: a cell array of text, left out",
        "z: complex numbers, left out",
        "none: an empty array, left out",
    ]
    assert set(MatRecords.read(path)) == {"q"}


def test_cells_of_numbers_are_numbered_in_braces(tmp_path: Path) -> None:
    path = tmp_path / "cells.mat"
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = np.arange(3.0), np.ones((4, 2))
    scipy.io.savemat(path, {"runs": cells})
    assert {name: values.shape for name, values in MatRecords.read(path).items()} == {
        "runs{1}": (3,),
        "runs{2}": (4, 2),
    }


def test_a_damaged_file_is_rejected_wherever_it_was_cut(tmp_path: Path) -> None:
    whole = saved(tmp_path).read_bytes()
    path = tmp_path / "cut.mat"
    messages = []
    for length in range(1, len(whole) - 1, 7):
        path.write_bytes(whole[:length])
        messages.append(message_of(path))
    assert all("cut.mat" in message for message in messages if message)
    assert sum(map(bool, messages)) > len(messages) / 2  # cut between two variables a file is whole


def test_text_is_no_matlab_file(tmp_path: Path) -> None:
    path = tmp_path / "text.mat"
    path.write_text("q,tau\n1,2\n" * 100)
    with pytest.raises(DataRejected, match=r"text\.mat: cannot be read as a MATLAB file"):
        MatRecords.read(path)


@fault(
    "A02",
    sees="exit 5: the variable at byte 128 is damaged, also where scipy takes it without its checksum",
    mutant=("adapters/robid_tables/mat.py", "    check_elements(path)\n", "    pass\n"),
)
def test_a_packed_variable_must_fit_its_checksum(tmp_path: Path) -> None:
    path = tmp_path / "packed.mat"
    scipy.io.savemat(path, {"q": np.arange(50.0)}, do_compression=True)
    whole = path.read_bytes()
    length = int.from_bytes(whole[132:136], "little")
    path.write_bytes(whole[:132] + (length - 4).to_bytes(4, "little") + whole[136:-4])  # without the checksum
    assert scipy.io.loadmat(path)["q"].shape == (1, 50)  # scipy says nothing
    with pytest.raises(DataRejected, match=r"A02: .*packed\.mat: the variable at byte 128 is damaged"):
        MatRecords.read(path)


@pytest.mark.parametrize("packed", [False, True])
def test_a_variable_that_is_cut_is_told_with_its_byte(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "cut.mat"
    scipy.io.savemat(path, {"a": np.arange(3.0), "q": np.arange(50.0)}, do_compression=packed)
    whole = path.read_bytes()
    second = 128 + 8 + int.from_bytes(whole[132:136], "little")
    for length in (second + 1, second + 20, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(DataRejected, match=f"A01: .* the variable at byte {second} is cut"):
            MatRecords.read(path)


def test_files_of_version_4_and_of_other_machines_pass(tmp_path: Path) -> None:
    path = tmp_path / "old.mat"
    scipy.io.savemat(path, {"q": np.arange(5.0)}, format="4")
    check_elements(path)
    assert MatRecords.read(path)["q"].shape == (5,)
    content = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI"
    element = (14).to_bytes(4, "big") + (8).to_bytes(4, "big") + bytes(8)
    path.write_bytes(content + element)
    check_elements(path)
    path.write_bytes(content + element[:-1])
    with pytest.raises(DataRejected, match="byte 128 is cut"):
        check_elements(path)


def test_a_file_cut_right_behind_its_header_is_told(tmp_path: Path) -> None:
    file = tmp_path / "log.mat"
    scipy.io.savemat(file, {"q": np.arange(5.0)})
    file.write_bytes(file.read_bytes()[:128])
    with pytest.raises(DataRejected, match=r"A01: .*log.mat: no variable stands behind the header"):
        MatRecords.read(file)
