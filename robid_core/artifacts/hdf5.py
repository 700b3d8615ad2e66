"""Artifacts as HDF5 files that others can open: names, axes and units inside, equal content in equal bytes.

Layout: the root group carries `robid_artifact` (class name) and `robid_version`; each array field is a
dataset with the attributes `axes`, `unit` (and dimension labels); plain values are attributes; nested
artifacts are groups of the same shape, tuples of them groups `0000`, `0001`, ... Complex numbers are compound
(`r`, `i`), as h5py writes and MATLAB, Julia and h5py read them. Behind the HDF5, where its readers do not look, stands
the SHA-256 of all before it (`seal.py`).
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid_core.artifacts import seal
from robid_core.artifacts.artifact import Artifact
from robid_core.artifacts.freezing import frozen
from robid_core.errors import DataRejected, StoreError
from robid_core.foreign.process import read_apart

FORMAT_VERSION = 2  # 1 had no seal
BLOCK = 1 << 20  # bytes by which a file in memory grows


def artifact_classes() -> dict[str, type[Artifact]]:
    """Return every loaded artifact class by name."""
    found: dict[str, type[Artifact]] = {}
    waiting: list[type[Artifact]] = [Artifact]
    while waiting:
        cls = waiting.pop()
        found[cls.__name__] = cls
        waiting.extend(cls.__subclasses__())
    return found


def write_hdf5(artifact: Artifact, path: Path) -> None:
    """Write an artifact; the bytes depend on its content only (no times, tracked order, no compression).

    HDF5 builds the file in memory: on a disk that is full it could not close its own file, and the process
    crashed at its end. The bytes are the same.
    """
    with h5py.File(
        "in memory",
        "w",
        libver=("v110", "v110"),
        track_order=True,
        driver="core",
        backing_store=False,
        block_size=BLOCK,
    ) as file:
        file.attrs["robid_version"] = FORMAT_VERSION
        _write_group(file, artifact)
        file.flush()
        image = file.id.get_file_image()
    try:
        path.write_bytes(image + seal.of(image))
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error}") from error


def read_hdf5(path: Path) -> Artifact:
    """Read whatever artifact the file holds, its bytes verified before HDF5 sees them.

    A file without a seal (of a format before this one, of somebody else, cut or changed) is read in the process for
    files of others.

    Raises
    ------
    StoreError
        If the file is damaged, or holds no artifact.
    """
    if seal.is_intact(path):
        return read_sealed(path)
    try:
        artifact: Artifact = read_apart(path, f"{__name__}:read_unsealed", "", "an artifact of robid")
    except DataRejected as error:
        raise StoreError(str(error)) from error
    return artifact


def read_sealed(path: Path) -> Artifact:
    """Read an artifact whose bytes were verified."""
    try:
        with h5py.File(path, "r") as file:
            return _read_file(file, path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error


def read_unsealed(path: Path) -> Artifact:
    """Read an artifact of a format that had no seal; StoreError where it is of one that has."""
    try:
        with h5py.File(path, "r") as file:
            version = int(file.attrs.get("robid_version", 0)) if "robid_artifact" in file.attrs else 1
            if version == FORMAT_VERSION:
                raise StoreError(
                    f"{path}: damaged: its seal is missing, the end is cut or changed; bring it back from a copy, or "
                    "make it again with robid run"
                )
            return _read_file(file, path)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error


def _read_file(file: h5py.File, path: Path) -> Artifact:
    if "robid_artifact" not in file.attrs:
        raise StoreError(f"{path}: an HDF5 file, but not one of robid's: 'robid_artifact' is missing")
    if int(file.attrs.get("robid_version", 0)) > FORMAT_VERSION:
        raise StoreError(f"{path}: written by a newer robid; update robid to read it")
    return _read_group(file, str(path))


def _write_group(group: h5py.Group, artifact: Artifact) -> None:
    group.attrs["robid_artifact"] = type(artifact).__name__
    for item in dataclasses.fields(artifact):
        value = getattr(artifact, item.name)
        if value is None:
            continue
        if "axes" in item.metadata:
            _write_array(group, item, value)
        elif isinstance(value, Artifact):
            _write_group(group.create_group(item.name, track_order=True), value)
        elif isinstance(value, dict):
            child = group.create_group(item.name, track_order=True)
            child.attrs["robid_container"] = "dict"
            for key, nested in value.items():
                _write_group(child.create_group(key, track_order=True), nested)
        elif isinstance(value, tuple) and value and isinstance(value[0], Artifact):
            child = group.create_group(item.name, track_order=True)
            child.attrs["robid_container"] = "tuple"
            for index, nested in enumerate(value):
                _write_group(child.create_group(f"{index:04d}", track_order=True), nested)
        elif isinstance(value, tuple):
            group.attrs[item.name] = json.dumps(value)
        elif isinstance(value, str | bool | int | float):
            group.attrs[item.name] = value
        else:
            raise DataRejected(f"{artifact.place(item.name)}: cannot store a {type(value).__name__}")


def _write_array(group: h5py.Group, item: dataclasses.Field[Any], value: np.ndarray[Any, Any]) -> None:
    data = group.create_dataset(item.name, data=np.ascontiguousarray(value), track_times=False)
    data.attrs["axes"] = " ".join(item.metadata["axes"])
    data.attrs["unit"] = item.metadata["unit"]
    for dimension, name in zip(data.dims, item.metadata["axes"], strict=True):
        dimension.label = name


def _read_group(group: h5py.Group, path: str) -> Artifact:
    name = str(group.attrs.get("robid_artifact", "?"))
    cls = artifact_classes().get(name)
    if cls is None:
        raise StoreError(f"{path}: holds an artifact of class {name}, which no installed package defines")
    values: dict[str, Any] = {}
    missing = []
    for item in dataclasses.fields(cls):
        if item.name in group:
            values[item.name] = _read_item(group[item.name], path)
        elif item.name in group.attrs:
            values[item.name] = _read_value(group.attrs[item.name], item)
        elif item.default is item.default_factory is dataclasses.MISSING:
            missing.append(item.name)
    if missing:
        raise StoreError(
            f"{path}: {group.name} is not a whole {name} of this version of robid: {', '.join(missing)} is missing; "
            "make it again"
        )
    try:
        return cls(**values)
    except DataRejected as error:
        raise StoreError(
            f"{path}: {group.name} cannot be a {name} of this version of robid: {error}"
        ) from error


def _read_item(node: h5py.Group | h5py.Dataset, path: str) -> Any:
    if isinstance(node, h5py.Dataset):
        return frozen(node[()])
    container = node.attrs.get("robid_container")
    if container == "dict":
        return {key: _read_group(child, path) for key, child in node.items()}
    if container == "tuple":
        return tuple(_read_group(child, path) for child in node.values())
    return _read_group(node, path)


def _read_value(value: Any, item: dataclasses.Field[Any]) -> Any:
    if str(item.type).startswith("tuple"):
        return _as_tuple(json.loads(value))
    return value.item() if isinstance(value, np.generic) else value


def _as_tuple(value: Any) -> Any:
    return tuple(_as_tuple(entry) for entry in value) if isinstance(value, list) else value
