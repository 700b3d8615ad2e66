"""A sealed artifact is verified before HDF5 opens it; what has no seal is read apart, or refused."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from faults.fault import fault

from robid_core import Configurations, Report
from robid_core.artifacts import Artifact, seal
from robid_core.errors import StoreError

ANGLE = np.linspace(-1, 1, 12).reshape(4, 3)


def written(folder: Path) -> Path:
    path = folder / "where.h5"
    Configurations(axis_names=("a", "b", "c"), angle=ANGLE).write(path)
    return path


@fault(
    "R06",
    sees="exit 7: the file is damaged, and where another may come from; HDF5 never opens it",
    mutant=(
        "robid_core/artifacts/seal.py",
        "    if found != MARK + digest.hexdigest().encode():",
        "    if not found:",
    ),
)
def test_a_changed_byte_anywhere_is_told_before_hdf5_sees_it(tmp_path: Path) -> None:
    path = written(tmp_path)
    whole = path.read_bytes()
    for place in [*range(0, len(whole), 97), *range(len(whole) - seal.LENGTH, len(whole), 7)]:
        content = bytearray(whole)
        content[place] ^= 0x10
        path.write_bytes(content)
        with pytest.raises(StoreError, match=r"where\.h5: damaged"):
            Artifact.read(path)


@fault(
    "R06",
    sees="exit 7: the end of the file is missing",
    mutant=(
        "robid_core/artifacts/hdf5.py",
        "            if version == FORMAT_VERSION:",
        "            if version is None:",
    ),
)
def test_a_file_without_its_seal_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: -seal.LENGTH])
    with pytest.raises(StoreError, match=r"where\.h5: damaged: its seal is missing"):
        Artifact.read(path)
    for length in (0, 10, len(whole) // 2, len(whole) - seal.LENGTH - 1, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(StoreError, match=r"where\.h5"):
            Artifact.read(path)


def test_others_open_a_sealed_file_as_ever(tmp_path: Path) -> None:
    with h5py.File(written(tmp_path), "r") as file:
        np.testing.assert_array_equal(file["angle"][()], ANGLE)


def test_a_file_of_the_format_before_is_read(tmp_path: Path) -> None:
    path = written(tmp_path)
    with h5py.File(path, "a") as file:  # takes the seal away
        file.attrs["robid_version"] = 1
    assert not seal.is_intact(path)
    np.testing.assert_array_equal(Configurations.read(path).angle, ANGLE)


def test_equal_content_gives_equal_bytes_seal_and_all(tmp_path: Path) -> None:
    (tmp_path / "again").mkdir()
    assert written(tmp_path).read_bytes() == written(tmp_path / "again").read_bytes()


@fault(
    "R06",
    sees="exit 7: the page is damaged at a byte where no text is",
    mutant=(
        "robid_core/artifacts/report.py",
        "        except UnicodeDecodeError as error:",
        "        except KeyError as error:",
    ),
)
def test_a_page_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_bytes(b"<html>\xff</html>")
    with pytest.raises(StoreError, match=r"page\.html: damaged at byte 6"):
        Report.read(path)
