"""Files of measured data: where they lie below the data root, that they are the ones meant, and who reads them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from robid_core import (
    BAG_READER,
    ConfigurationError,
    DataPath,
    DataRejected,
    files_of,
    guarded_reader,
    is_bag,
    is_recording,
    record_readers,
)

SPREADSHEETS = (".xlsx", ".xls", ".xlsm", ".ods")
_BELOW_ROOT: TypeAdapter[str] = TypeAdapter(DataPath)


def advice(path: str, origin: str) -> str:
    """Say how to get at data that are not there."""
    source = f"get it from {origin} and " if origin else ""
    return f"{source}set ROBID_DATA or pass --data to the folder that holds {path}"


def below_root(path: str) -> str:
    """Return a path that stays below the data root; ValueError says how it leaves it (fault Y05)."""
    try:
        return _BELOW_ROOT.validate_python(path)
    except ValidationError as error:
        raise ValueError(error.errors()[0]["msg"].partition(", ")[2]) from error


def find_file(root: Path | None, path: str, origin: str) -> Path:
    """Return where a data file is, or the folder of a bag; ConfigurationError tells where to get it."""
    if root is None:
        raise ConfigurationError(f"no data folder is set; {advice(path, origin)}")
    full = Path(root) / path
    if full.is_dir() and not is_bag(full):
        raise ConfigurationError(
            f"{full} is a folder, and no bag of ROS 2 (which has a metadata.yaml); name a file of it, or "
            "several by pattern or index"
        )
    if not is_recording(full):
        raise ConfigurationError(f"there is no file {full}; {advice(path, origin)}")
    return full


def reader_name(path: str, format_name: str) -> str:
    """Return the name of the reader of a file, by its suffix where no format is given; empty where none is known."""
    return format_name or record_readers().get(Path(path).suffix.lower().removeprefix("."), "")


def reader_of(root: Path | None, path: str, format_name: str) -> Any:
    """Return the reader of a data file below the data root, or of a bag, which reads in a process of its own."""
    name = reader_name(path, format_name)
    if not format_name and root is not None and is_bag(root / path):
        name = BAG_READER
    if not name:
        known = ", ".join(sorted(set(record_readers().values())))
        table = "save its table as CSV, or " if Path(path).suffix.lower() in SPREADSHEETS else ""
        raise ConfigurationError(f"{path}: no reader for '{Path(path).suffix}'; {table}give format: {known}")
    return guarded_reader(name)


def refuse_others(files: Sequence[Path], sha256: str, name: str, origin: str) -> None:
    """Raise DataRejected (fault A13) where data are not those that a pipeline was written for.

    The hash of one file is its own; that of several is the hash of what ``sha256sum`` prints of their hashes and
    names, in the order of the files: ``sha256sum c*.npz | sha256sum`` in their folder.
    """
    if not sha256:
        return
    files = [one for file in files for one in files_of(file)]
    hashes = [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
    found, what = hashes[0], "another file"
    if len(files) > 1:
        lines = "".join(f"{digest}  {file.name}\n" for digest, file in zip(hashes, files, strict=True))
        found, what = hashlib.sha256(lines.encode()).hexdigest(), "other files"
    if found != sha256.lower():
        raise DataRejected(
            f"A13: {name} is {what} than the one this pipeline was written for: its sha256 is {found}; "
            f"{advice(name, origin)}, or correct sha256"
        )
