"""NumPy archives (.npz) as named arrays; nothing pickled is ever opened.

The checksum of a member stands at its end: a member is read whole before anything in it is believed, and an array must
fill it to the last byte.
"""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from robid_core import DataRejected, FloatArray, StoreError

_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_SUFFIX = ".npy"
_LONGEST_END = 22 + 2**16  # with a comment
_SAID_ELSEWHERE = 2**16 - 1  # in the record for long archives


def read_arrays(path: Path) -> dict[str, FloatArray]:
    """Return every real numeric array of the archive; arrays of text are left out.

    Raises
    ------
    DataRejected
        If the file is no archive, is damaged, or holds Python objects (which could run code when opened); the message
        has the member.
    StoreError
        If it cannot be read.
    """
    arrays: dict[str, FloatArray] = {}
    name = ""
    try:
        with zipfile.ZipFile(path) as archive:
            _check_count(path, len(archive.infolist()))
            for member in archive.infolist():
                name = member.filename
                content = archive.read(member)  # to the end, where zipfile compares the checksum
                if name.endswith(_SUFFIX):
                    values = _array(path, name, content)
                    if values.dtype.kind in "fiub":
                        arrays[name.removesuffix(_SUFFIX)] = values.astype(np.float64)
    except DataRejected:
        raise
    except FileNotFoundError as error:
        raise StoreError(f"{path}: cannot be read ({error.strerror})") from error
    except Exception as error:  # zipfile meets whatever stands in a damaged directory
        raise _damaged(path, name, error) from error
    if not arrays:
        raise DataRejected(f"{path}: the archive holds no numeric array")
    return arrays


def claimed_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Return the shapes of arrays of real numbers that their headers claim; raises DataRejected as `read_arrays`."""
    shapes: dict[str, tuple[int, ...]] = {}
    name = ""
    try:
        with zipfile.ZipFile(path) as archive:
            for name in (one for one in archive.namelist() if one.endswith(_SUFFIX)):
                with archive.open(name) as stream:
                    version = np.lib.format.read_magic(stream)
                    if version not in _HEADERS:
                        continue
                    shape, _, dtype = _HEADERS[version](stream)
                if dtype.kind in "fiub":
                    shapes[name.removesuffix(_SUFFIX)] = shape
    except Exception as error:  # as above
        raise _damaged(path, name, error) from error
    return shapes


def _damaged(path: Path, name: str, error: Exception) -> DataRejected:
    place = f", member {name}" if name else ""
    return DataRejected(
        f"A02: {path}{place}: no intact NumPy archive ({error}); copy it again, or save it anew"
    )


def _check_count(path: Path, n_member: int) -> None:
    """Raise DataRejected where the directory lists another number of members than the archive's end states."""
    with path.open("rb") as file:
        file.seek(-min(path.stat().st_size, _LONGEST_END), 2)
        end = file.read()
    place = end.rfind(b"PK\x05\x06") + 10  # end of central directory, number of its entries
    stated = int.from_bytes(end[place : place + 2], "little")
    if stated not in (n_member, _SAID_ELSEWHERE):
        raise DataRejected(
            f"A02: {path}: no intact NumPy archive: it states {stated} members and lists {n_member}; copy it again"
        )


def _array(path: Path, name: str, content: bytes) -> np.ndarray[Any, Any]:
    """Return the array of a member; one of another type than numbers comes empty."""
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    if version not in _HEADERS:  # of tables with names that are no ASCII
        return np.empty(0, dtype=np.str_)
    shape, in_columns, dtype = _HEADERS[version](stream)
    if dtype.hasobject:
        raise DataRejected(
            f"{path}, member {name}: holds Python objects, which are never opened; save plain arrays, "
            "not Python objects"
        )
    wanted, there = math.prod(shape) * dtype.itemsize, len(content) - stream.tell()
    if wanted != there or min(shape, default=0) < 0:
        raise DataRejected(
            f"A04: {path}, member {name}: its header claims {shape} numbers of {dtype.itemsize} bytes, {wanted} bytes, "
            f"and {there} follow; save it anew"
        )
    values: np.ndarray[Any, Any] = np.frombuffer(content, dtype, offset=stream.tell())
    return values.reshape(shape, order="F" if in_columns else "C")


class NpzRecords:
    """Reader of NumPy archives, registered as `npz` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each array."""
        return [f"{name}: {values.shape}" for name, values in read_arrays(path).items()]

    @staticmethod
    def shapes(path: Path) -> dict[str, tuple[int, ...]]:
        """Return the shapes that the members' headers claim, by name; their numbers are not read."""
        return claimed_shapes(path)

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the arrays by name."""
        return read_arrays(path)
