"""Variables of MATLAB files of version 7.3, which are HDF5.

Data sets carry `MATLAB_class` and have MATLAB's dimensions in reverse, as HDF5 counts them in the order of C. A
structure is a group; in an array of structures each field is a data set of references, and so is a cell array.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid_core import DataRejected
from robid_tables.matlab_values import LeftOut

DEEPEST = 50  # structures within one another; more is a file that refers to itself
NUMERIC = {
    "double", "single", "logical",
    "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64",
}  # fmt: skip


def read_hdf5_variables(path: Path) -> dict[str, Any]:
    """Return the variables of a file as `matlab_values` takes them; h5py's errors where the file is damaged."""
    with h5py.File(path, "r") as file:
        return {name: _value(path, file, item, 0) for name, item in file.items() if not name.startswith("#")}


def _value(path: Path, file: h5py.File, item: Any, depth: int) -> Any:
    if depth > DEEPEST:
        raise DataRejected(f"{path}: structures refer to one another without end; the file is damaged")
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if "MATLAB_sparse" in item.attrs:
        return LeftOut("a sparse matrix")
    if "MATLAB_object_decode" in item.attrs:
        return LeftOut(f"an object ({kind})")
    if isinstance(item, h5py.Group):
        return (
            _structure(path, file, item, depth) if kind in ("struct", "") else LeftOut(f"an object ({kind})")
        )
    if item.attrs.get("MATLAB_empty", 0):
        return () if kind == "cell" else LeftOut("text" if kind == "char" else "an empty array")
    if kind == "cell":
        return tuple(_value(path, file, file[one], depth + 1) for one in item[()].ravel())
    if kind == "char":
        return LeftOut("text")
    if item.dtype.names == ("real", "imag"):
        return LeftOut("complex numbers")
    if kind in NUMERIC:
        return np.asarray(item[()]).T
    if kind or item.dtype.kind not in "fiub":
        return LeftOut(f"an object ({kind})" if kind else "no plain numbers")
    return np.asarray(item[()])  # not written by MATLAB: the order is that of the file


def _structure(path: Path, file: h5py.File, group: h5py.Group, depth: int) -> Any:
    fields = dict(group.items())
    referring = {
        name: field
        for name, field in fields.items()
        if isinstance(field, h5py.Dataset)
        and field.dtype == h5py.ref_dtype
        and "MATLAB_class" not in field.attrs
    }
    if not referring or len(referring) < len(fields):
        return {name: _value(path, file, field, depth + 1) for name, field in fields.items()}
    columns = {name: field[()].ravel() for name, field in referring.items()}
    return [
        {name: _value(path, file, file[one], depth + 1) for name, one in zip(columns, entry, strict=True)}
        for entry in zip(*columns.values(), strict=True)
    ]
