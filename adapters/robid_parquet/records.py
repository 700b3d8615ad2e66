"""Parquet files as named columns.

Structures are flattened to `motor.position`; lists of one length become a table (n_row, n_value); instants become
seconds, those of a calendar since 1970. A value that is absent is NaN, and told.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.compute
import pyarrow.parquet

from robid_core import DataRejected, FloatArray

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def read_columns(path: Path) -> tuple[dict[str, FloatArray], list[str]]:
    """Return the columns of numbers, each (n_row,) or (n_row, n_value), and remarks on the others.

    Raises
    ------
    DataRejected
        If the file is no Parquet file, is damaged, or holds no numbers.
    """
    try:
        table = pyarrow.parquet.ParquetFile(path, page_checksum_verification=True).read()
        while any(pyarrow.types.is_struct(kind) for kind in table.schema.types):
            table = table.flatten()
    except (pyarrow.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0]
        raise DataRejected(f"{path}: cannot be read as Parquet ({reason})") from error
    twice = next((name for name in table.column_names if table.column_names.count(name) > 1), None)
    if twice is not None:
        raise DataRejected(f"{path}: two columns are called '{twice}'; rename one")
    columns: dict[str, FloatArray] = {}
    remarks: list[str] = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        values, told = _values(column)
        if told:
            remarks.append(f"{name}: {told}")
        if values is not None:
            columns[name] = values
    if not columns:
        raise DataRejected(f"{path}: holds no numbers")
    return columns, remarks


def plain_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Return the shape of each column without reading one; none where lists or structures are among them."""
    try:
        file = pyarrow.parquet.ParquetFile(path)
    except (pyarrow.ArrowException, OSError) as error:
        raise DataRejected(
            f"{path}: cannot be read as Parquet ({str(error).partition(chr(10))[0]})"
        ) from error
    schema = file.schema_arrow
    if any(pyarrow.types.is_nested(kind) for kind in schema.types):
        return {}
    return dict.fromkeys(schema.names, (file.metadata.num_rows,))


def _values(column: pyarrow.ChunkedArray) -> tuple[FloatArray | None, str]:
    """Return the numbers of a column, None where it has none, and what there is to say."""
    kind = column.type
    if _is_list(kind):
        return _table(column)
    if pyarrow.types.is_dictionary(kind):
        return _values(column.cast(kind.value_type))
    factor, told = 1.0, ""
    if pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind):
        factor = _SECONDS[kind.unit]
        told = f"{kind}, read in seconds"
        column = column.cast(pyarrow.int64())
    elif pyarrow.types.is_decimal(kind):
        column = column.cast(pyarrow.float64())
    elif not (
        pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind) or pyarrow.types.is_boolean(kind)
    ):
        return None, f"{kind}, left out"
    if column.null_count:
        absent = f"absent in {column.null_count} of {len(column)} rows, NaN there"
        told = f"{told}; {absent}" if told else absent
    values = _plain(column)
    return (values * factor if factor != 1.0 else values), told


def _plain(column: pyarrow.ChunkedArray) -> FloatArray:
    """Return numbers as float64, NaN where absent."""
    if pyarrow.types.is_boolean(column.type):
        column = column.cast(pyarrow.int8())
    floats = column.cast(pyarrow.float64(), safe=False)  # counts above 2^53 are rounded
    values: FloatArray = np.asarray(floats.to_numpy(), dtype=np.float64)
    return values


def _is_list(kind: pyarrow.DataType) -> bool:
    types = pyarrow.types
    return bool(types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind))


def _table(column: pyarrow.ChunkedArray) -> tuple[FloatArray | None, str]:
    """Return lists of one length as (n_row, n_value)."""
    lengths = set(pyarrow.compute.list_value_length(column).unique().to_pylist())
    if len(lengths) != 1 or lengths <= {None, 0}:
        return None, f"{column.type} of different lengths, left out"
    flat = pyarrow.compute.list_flatten(column)
    values, told = (None, f"{column.type}, left out") if _is_list(flat.type) else _values(flat)
    return (values if values is None else values.reshape(len(column), -1)), told


class ParquetRecords:
    """Reader of Parquet files, registered as `parquet` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each column, and what is left out."""
        columns, remarks = read_columns(path)
        return [*(f"{name}: {values.shape}" for name, values in columns.items()), *remarks]

    @staticmethod
    def shapes(path: Path) -> dict[str, tuple[int, ...]]:
        """Return the shapes of plain columns by the file's footer; none where others nest in it."""
        return plain_shapes(path)

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the columns by name."""
        return read_columns(path)[0]
