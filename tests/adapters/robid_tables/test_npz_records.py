"""NumPy archives become named arrays; a pickle inside is refused and never run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import DataRejected
from robid_tables.npz import NpzRecords


class Trap:
    """An object whose unpickling leaves a trace."""

    sprung: list[str] = []

    def __reduce__(self) -> tuple[Any, ...]:
        return (Trap.sprung.append, ("run",))


def test_arrays_come_back_as_numbers_and_text_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    np.savez(path, q=np.arange(4, dtype=np.int32), tau=np.ones((4, 6)), label=np.array(["a", "b"]))
    columns = NpzRecords.read(path)
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


def test_a_changed_byte_in_the_data_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    np.savez(path, q=np.arange(1000.0))
    whole = bytearray(path.read_bytes())
    whole[4000] ^= 1
    path.write_bytes(bytes(whole))
    with pytest.raises(DataRejected, match="CRC"):
        NpzRecords.read(path)


def test_an_archive_without_numbers_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "empty.npz"
    np.savez(path, label=np.array(["a"]))
    with pytest.raises(DataRejected, match="no numeric array"):
        NpzRecords.read(path)
