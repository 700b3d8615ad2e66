"""HDF5 as named arrays: a record that robid wrote, or the data sets of any other file by their paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid_core import DataRejected, FloatArray, Record, RobidError

MARK = "robid_artifact"  # attribute of the files of artifacts


def read_data_sets(path: Path) -> tuple[dict[str, FloatArray], list[str]]:
    """Return the data sets of real numbers by path (`drive/position`), and what others hold.

    Fields of a table (a compound data set) are columns `table/position`; single numbers have the shape ().

    Raises
    ------
    DataRejected
        If the file is no HDF5, is damaged, or holds no numbers.
    """
    arrays: dict[str, FloatArray] = {}
    remarks: list[str] = []

    def visit(name: str | bytes, item: Any) -> None:
        if isinstance(name, bytes):  # h5py gives so what it cannot decode
            raise ValueError(
                f"the name {name!r} is no UTF-8: it is damaged, or was written in another encoding"
            )
        if not isinstance(item, h5py.Dataset):
            return
        if item.dtype.names:
            content = item[()]
            found = {f"{name}/{field}": np.asarray(content[field]) for field in item.dtype.names}
        else:
            found = {name: np.asarray(item[()])} if item.dtype.kind in "fiub" else {}
            if not found:
                remarks.append(f"{name}: no real numbers, left out")
        for column, values in found.items():
            if values.dtype.kind in "fiub" and values.size:
                arrays[column] = values.astype(np.float64)
            else:
                remarks.append(f"{column}: {'no real numbers' if values.size else 'empty'}, left out")

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise DataRejected(f"{path}: cannot be read as HDF5 ({error})") from error
    if not arrays:
        raise DataRejected(f"{path}: holds no numbers")
    return arrays, remarks


def data_set_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Return the shapes of what `read_data_sets` reads, by path; raises DataRejected as it does."""
    shapes: dict[str, tuple[int, ...]] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.size:
            fields = item.dtype.fields or {"": (item.dtype, 0)}
            for field, (kind, *_) in fields.items():
                if kind.base.kind in "fiub":
                    shapes[f"{name}/{field}" if field else name] = (*item.shape, *kind.shape)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise DataRejected(f"{path}: cannot be read as HDF5 ({error})") from error
    return shapes


def _is_artifact(path: Path) -> bool:
    try:
        with h5py.File(path, "r") as file:
            return MARK in file.attrs
    except OSError as error:
        raise DataRejected(f"{path}: cannot be read as HDF5 ({error})") from error


class Hdf5Records:
    """Reader of HDF5 files, registered as `hdf5` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each data set; of a record its axes, and the length and the channels of its runs."""
        if _is_artifact(path):
            try:
                record = Hdf5Records.read_record(path)
            except RobidError as error:
                return [str(error)]
            return [f"a record of robid: axes {', '.join(record.axis_names)}", *_run_lines(record)]
        arrays, remarks = read_data_sets(path)
        return [
            *(
                f"{name}: {values.item():g}" if values.ndim == 0 else f"{name}: {values.shape}"
                for name, values in arrays.items()
            ),
            *remarks,
        ]

    @staticmethod
    def shapes(path: Path) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the data sets by path; their numbers are not read."""
        return data_set_shapes(path)

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the data sets by path."""
        return read_data_sets(path)[0]

    @staticmethod
    def read_record(path: Path) -> Record:
        """Return the record that a run of robid wrote; DataRejected where the file holds something else."""
        if not _is_artifact(path):
            raise DataRejected(
                f"{path}: no record of robid; give channels, a map from names to its data sets"
            )
        return Record.read(path)


def _run_lines(record: Record) -> list[str]:
    lines = []
    for run in record.runs:
        shape = " x ".join(
            f"{length} {noun}"
            for length, noun in zip(
                run.valid.shape,
                ("configurations", "blocks", "experiments", "periods", "samples"),
                strict=True,
            )
        )
        channels = ", ".join(f"{name} [{channel.unit_symbol}]" for name, channel in run.channels.items())
        lines.append(f"{shape}, every {run.sample_time_s:g} s: {channels}")
    return lines
