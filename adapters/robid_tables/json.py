"""JSON as named columns: a list of records, lists by name, or a log whose entries stand beside constants.

`{"mass": 0.49, "entries": [{"timestamp": 0.0, "position": 0.1}, ...]}` gives the columns `timestamp` and `position` and
the constant `mass`, a number of shape (). Records within records are flattened to `motor.position`. What a record lacks
is NaN, and told. Dates with times of day become seconds.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from robid_core import DataRejected, FloatArray, StoreError
from robid_tables.instants import TOLD, instants
from robid_tables.notation import NUMBER, foreign_notation


def read_log(path: Path) -> tuple[dict[str, FloatArray], list[str]]:
    """Return columns (n_entry,) or (n_entry, n_value) and constants () by name, and remarks on what is left out.

    Raises
    ------
    DataRejected
        If the file is no JSON, or cut, or a text looks like a number.
    """
    content = _parsed(path)
    remarks: list[str] = []
    columns: dict[str, FloatArray] = {}
    if isinstance(content, list):
        content = {"": content}
    if not isinstance(content, dict):
        raise DataRejected(f"{path}: holds a single value; a log is a list of records or lists by name")
    logs = [name for name, value in content.items() if _is_records(value)]
    for name, value in content.items():
        inner = "" if logs == [name] else name
        found = _records(value) if name in logs else dict(_flat(value, name or "1"))
        for column, values in found.items():
            _enter(path, f"{inner}.{column}" if inner and name in logs else column, values, columns, remarks)
    if not columns:
        raise DataRejected(f"{path}: holds no numbers")
    return columns, remarks


def _parsed(path: Path) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        entries = dict(pairs)
        if len(entries) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise DataRejected(f"{path}: '{twice}' stands twice in one record; rename one")
        return entries

    try:
        content = path.read_bytes()
        return json.loads(content.decode(json.detect_encoding(content)), object_pairs_hook=once)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read ({error.strerror or error})") from error
    except json.JSONDecodeError as error:
        cut = not error.doc[error.pos :].strip() or error.msg.startswith("Unterminated")
        what = "A01: the file looks cut" if cut else "no JSON"
        raise DataRejected(f"{path}:{error.lineno}: {what} ({error.msg})") from error
    except UnicodeDecodeError as error:
        raise DataRejected(f"{path}: not UTF-8 text at byte {error.start}; save it as UTF-8") from error
    except RecursionError as error:
        raise DataRejected(f"{path}: records within records are too deep; no log is like this") from error


def _is_records(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(entry, dict) for entry in value)


def _records(entries: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """Return a value for each entry by name, None where it has none."""
    columns: dict[str, list[Any]] = {}
    for index, entry in enumerate(entries):
        for name, value in _flat(entry, ""):
            column = columns.setdefault(name, [None] * len(entries))
            column[index] = value
    return columns


def _flat(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{name}.{key}" if name else key)
    else:
        yield name, value


def _enter(path: Path, name: str, values: Any, columns: dict[str, FloatArray], remarks: list[str]) -> None:
    """Put values under their name where they are numbers, else say what they are."""
    flat = values if isinstance(values, list) else [values]
    texts = [value for value in flat if isinstance(value, str)]
    for text in texts:
        if NUMBER.fullmatch(text.strip()) or foreign_notation(text.strip()):
            raise DataRejected(f"{path}: '{name}' holds the text '{text}'; write numbers without quotes")
    seconds = instants(texts) if len(texts) == len(flat) else None
    if seconds is not None:
        remarks.append(f"{name}: {TOLD}")
        columns[name] = seconds
        return
    if texts:
        shown = f" '{texts[0]}'" if not isinstance(values, list) else ""
        remarks.append(f"{name}: text{shown}, left out")
        return
    missing = sum(value is None for value in flat)
    lists = {len(value) for value in flat if isinstance(value, list)}
    if lists:
        width = max(lists)
        if len(lists) > 1 or missing == len(flat) or not width:
            remarks.append(f"{name}: lists of different lengths, left out")
            return
        flat = [[None] * width if value is None else value for value in flat]
    try:
        array = np.array(flat if isinstance(values, list) else flat[0], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        remarks.append(f"{name}: no plain numbers, left out")
        return
    if not array.size or (missing == len(flat)):
        remarks.append(f"{name}: empty, left out")
        return
    if missing:
        remarks.append(f"{name}: absent in {missing} of {len(flat)} entries, NaN there")
    columns[name] = array


class JsonRecords:
    """Reader of JSON logs, registered as `json` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each column and each constant, and what is left out."""
        columns, remarks = read_log(path)
        constants = [name for name, values in columns.items() if values.ndim == 0]
        return [
            *(f"{name}: {values.shape}" for name, values in columns.items() if values.ndim),
            *(f"{name}: {columns[name].item():g}, a constant" for name in constants),
            *remarks,
        ]

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return columns and constants by name; constants have the shape ()."""
        return read_log(path)[0]
