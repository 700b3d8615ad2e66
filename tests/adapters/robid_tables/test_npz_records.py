"""NumPy archives become named arrays; a pickle inside is refused and never run."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults.fault import fault

from robid_core import DataRejected
from robid_tables.npz import NpzRecords


class Trap:
    """An object whose unpickling leaves a trace."""

    sprung: list[str] = []

    def __reduce__(self) -> tuple[Any, ...]:
        return (Trap.sprung.append, ("run",))


def test_arrays_come_back_as_numbers_and_text_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    torque = np.asfortranarray(np.arange(24.0).reshape(4, 6))  # stored column by column
    np.savez(path, q=np.arange(4, dtype=np.int32), tau=torque, label=np.array(["a", "b"]))
    columns = NpzRecords.read(path)
    np.testing.assert_array_equal(columns["tau"], torque)
    assert set(columns) == {"q", "tau"}
    assert columns["q"].dtype == np.float64
    assert NpzRecords.describe(path) == ["q: (4,)", "tau: (4, 6)"]


def test_a_pickle_is_refused_and_never_run(tmp_path: Path) -> None:
    path = tmp_path / "trap.npz"
    np.savez(path, q=np.array([Trap()], dtype=object))
    with pytest.raises(DataRejected, match="not Python objects"):
        NpzRecords.read(path)
    assert Trap.sprung == []


def test_a_cut_archive_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    np.savez_compressed(path, q=np.arange(1000.0))
    whole = path.read_bytes()
    for length in (0, 1, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(DataRejected, match=r"recording\.npz"):
            NpzRecords.read(path)


@fault(
    "A02",
    sees="exit 5: no intact archive, with the member and its checksum; copy it again, or save it anew",
    mutant=(
        "adapters/robid_tables/npz.py",
        "                content = archive.read(member)  #",
        "                content = archive.open(member).read(member.file_size - 1) + bytes(1)  #",
    ),
)
def test_a_changed_byte_in_the_data_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    np.savez(path, q=np.arange(1000.0))
    whole = bytearray(path.read_bytes())
    whole[4000] ^= 1
    path.write_bytes(bytes(whole))
    with pytest.raises(DataRejected, match=r"recording\.npz, member q\.npy: .*CRC"):
        NpzRecords.read(path)


def forged(path: Path, shape: tuple[int, ...]) -> None:
    """An archive of 24 numbers whose header, under a right checksum, claims another shape."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("q.npy", header.getvalue() + np.arange(24.0).tobytes())


@fault(
    "A04",
    sees="exit 5: the member's header claims so many numbers, and so many bytes follow; no memory is asked for",
    mutant=("adapters/robid_tables/npz.py", "    if wanted != there or", "    if"),
)
@pytest.mark.parametrize("shape", [(25,), (23,), (4, 5), (10**15,), (2**40, 2**40), (0, 3)])
def test_a_header_must_fit_the_bytes_that_follow(tmp_path: Path, shape: tuple[int, ...]) -> None:
    path = tmp_path / "forged.npz"
    forged(path, (4, 6))
    assert NpzRecords.read(path)["q"].shape == (4, 6)
    forged(path, shape)
    with pytest.raises(DataRejected, match=r"A04: .*forged\.npz, member q\.npy: its header claims \("):
        NpzRecords.read(path)


@fault(
    "A02",
    sees="exit 5: the archive states another number of members than it lists",
    mutant=(
        "adapters/robid_tables/npz.py",
        "            _check_count(path, len(archive.infolist()))",
        "            pass",
    ),
)
def test_a_member_that_the_directory_swallows_is_missed(tmp_path: Path) -> None:
    """Found by `tests/fuzz/run.py npz`: the length of an entry's comment reaches over the next entry."""
    path = tmp_path / "recording.npz"
    np.savez(path, t=np.arange(3.0), q=np.arange(3.0))
    content = bytearray(path.read_bytes())
    first = content.index(b"PK\x01\x02")
    second = content.index(b"PK\x01\x02", first + 4)
    content[first + 32 : first + 34] = (len(content) - 22 - second).to_bytes(2, "little")
    path.write_bytes(content)
    with pytest.raises(DataRejected, match="states 2 members and lists 1"):
        NpzRecords.read(path)


def test_an_archive_without_numbers_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "empty.npz"
    np.savez(path, label=np.array(["a"]))
    with pytest.raises(DataRejected, match="no numeric array"):
        NpzRecords.read(path)
