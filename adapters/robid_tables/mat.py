"""MATLAB files of all versions as named arrays; structures are flattened to `rec.act_pos_mot_deg`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque, mat_struct
from scipy.sparse import issparse

from robid_core import DataRejected, FloatArray
from robid_tables.matlab_elements import check_elements
from robid_tables.matlab_hdf5 import read_hdf5_variables
from robid_tables.matlab_values import LeftOut, flattened

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"  # a v7.3 file is HDF5 behind a MATLAB header of 512 bytes


def read_variables(path: Path) -> dict[str, FloatArray | LeftOut]:
    """Return every real numeric variable and structure field, unit dimensions squeezed, and what others hold.

    Raises
    ------
    DataRejected
        If the file is damaged, or no MATLAB file.
    """
    with path.open("rb") as file:
        start = file.read(520)
    newer = HDF5_SIGNATURE in (start[:8], start[512:520])
    try:
        variables = read_hdf5_variables(path) if newer else _older_variables(path)
    except DataRejected:
        raise
    except Exception as error:  # scipy and h5py raise whatever their parsers meet in a damaged file
        raise DataRejected(
            f"{path}: cannot be read as a MATLAB file ({type(error).__name__}: {error})"
        ) from error
    return dict(flattened(variables, ""))


def _older_variables(path: Path) -> dict[str, Any]:
    check_elements(path)
    with warnings.catch_warnings():
        # about names that occur twice in objects that are left out anyway
        warnings.simplefilter("ignore")
        content = scipy.io.loadmat(path, struct_as_record=False)
    variables = {name: _value(value) for name, value in content.items() if not name.startswith("__")}
    if not variables:
        raise DataRejected(f"A01: {path}: no variable stands behind the header; if it was cut, copy it again")
    return variables


def _value(value: Any) -> Any:
    """Bring what scipy gives into the form of `matlab_values`."""
    if isinstance(value, mat_struct):
        return {name: _value(getattr(value, name)) for name in value._fieldnames}
    if issparse(value):
        return LeftOut("a sparse matrix")
    if isinstance(value, MatlabObject | MatlabOpaque | MatlabFunction):
        return LeftOut("an object")
    if value.dtype.kind in "US":
        return LeftOut("text")
    if value.dtype != object:
        return value
    entries = value.ravel(order="F")
    if len(entries) and all(isinstance(entry, mat_struct) for entry in entries):
        return _value(entries[0]) if len(entries) == 1 else [_value(entry) for entry in entries]
    return tuple(
        _value(np.asarray(entry)) if not isinstance(entry, mat_struct) else _value(entry) for entry in entries
    )


class MatRecords:
    """Reader of MATLAB files, registered as `mat` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each variable: a number with its value, an array with its shape, what is left out."""
        lines = []
        for name, values in read_variables(path).items():
            if isinstance(values, LeftOut):
                lines.append(f"{name}: {values}, left out")
            else:
                lines.append(f"{name}: {values.item():g}" if values.ndim == 0 else f"{name}: {values.shape}")
        return lines

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the variables by name; single numbers have the shape ()."""
        return {
            name: values for name, values in read_variables(path).items() if not isinstance(values, LeftOut)
        }
