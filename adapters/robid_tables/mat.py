"""MATLAB files up to version 7 as named arrays; structures are flattened to `rec.act_pos_mot_deg`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from robid_core import DataRejected, FloatArray

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"  # a v7.3 file is HDF5 behind a MATLAB header of 512 bytes


def read_variables(path: Path) -> dict[str, FloatArray]:
    """Return every real numeric variable and structure field, unit dimensions squeezed.

    Text, cells and objects of MATLAB classes (tables, timeseries) are left out: they hold no plain numbers.

    Raises
    ------
    DataRejected
        If the file is of version 7.3, damaged, or no MATLAB file.
    """
    with path.open("rb") as file:
        start = file.read(520)
    if HDF5_SIGNATURE in (start[:8], start[512:520]):
        raise DataRejected(f"{path}: a MATLAB v7.3 file; in MATLAB, save it again with save(..., '-v7')")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # about names that occur twice in objects that are left out anyway
            content = scipy.io.loadmat(path, simplify_cells=True)
    except Exception as error:  # scipy raises whatever its parser meets in a damaged file
        raise DataRejected(
            f"{path}: cannot be read as a MATLAB file ({type(error).__name__}: {error})"
        ) from error
    return dict(_flatten(content, ""))


def _flatten(content: dict[Any, Any], prefix: str) -> Iterator[tuple[str, FloatArray]]:
    for key, value in content.items():
        if not isinstance(key, str) or key.startswith("__"):
            continue
        name = prefix + key
        if isinstance(value, dict):
            yield from _flatten(value, name + ".")
        elif isinstance(value, list | tuple) and value and all(isinstance(entry, dict) for entry in value):
            for index, entry in enumerate(value):
                yield from _flatten(entry, f"{name}({index + 1}).")
        else:
            array = np.asarray(value)
            if array.dtype.kind in "fiub" and array.size:
                yield name, array.astype(np.float64)


class MatRecords:
    """Reader of MATLAB files, registered as `mat` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each variable: a number with its value, an array with its shape."""
        return [
            f"{name}: {values.item():g}" if values.ndim == 0 else f"{name}: {values.shape}"
            for name, values in read_variables(path).items()
        ]

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the variables by name."""
        return read_variables(path)
