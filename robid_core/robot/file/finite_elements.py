"""Finite-element matrices of a link from a file (thesis section 2.6): numpy, MATLAB or Matrix Market.

What is read, whatever the format: `M` and `K`, mass and stiffness, (6 n_node, 6 n_node), whole (both triangles);
`nodes`, (n_node, 3). Six degrees of freedom a node, node by node, in the order ux uy uz rx ry rz; displacements and
rotations in the axes of `nodes`. The structure is free: nothing clamped. Nodes are counted from 0.

- `link.npz` (numpy.savez): arrays M, K, nodes. A sparse matrix is three arrays: M_row, M_column, M_value.
- `link.mat` (MATLAB, to version 7): variables M, K, nodes, full or sparse.
- `link_M.mtx` (Matrix Market; name this one): `link_K.mtx` and `link_nodes.mtx` stand beside it.
"""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.io
import scipy.io.matlab
import scipy.sparse

from robid_core.errors import ConfigurationError
from robid_core.robot.file.matrix_market import read_matrix_market

if TYPE_CHECKING:
    from robid_core.mechanics.flexible import Structure

Units = Literal["m_kg_s", "mm_t_s"]

_LARGEST = 50.0  # m; a link is smaller, node coordinates in mm are not
_SMALLEST = 1e-3  # m
_HEAVIEST = 1e5  # kg
_SUFFIX = "_M.mtx"
_DAMAGED = (
    ValueError, OSError, EOFError, TypeError, IndexError, KeyError, zipfile.BadZipFile, zlib.error,
    scipy.io.matlab.MatReadError,
)  # fmt: skip


def read_structure(path: Path, units: Units = "m_kg_s") -> Structure:
    """Read mass, stiffness and nodes of a structure.

    Parameters
    ----------
    path
        A `.npz`, `.mat` or `_M.mtx` file.
    units
        Of the file: "m_kg_s" (N, m, kg) or "mm_t_s" (N, mm, tonne); rotations are in rad in both.

    Raises
    ------
    ConfigurationError
        If the file is not there or damaged, a matrix is missing, has the wrong size, is not symmetric, is indefinite,
        or the size of the structure is not that of a link in these units.
    """
    from robid_core.mechanics.flexible import Structure

    if not path.is_file():
        raise ConfigurationError(
            f"finite elements: {path} is no file; give the path of a .npz, .mat or _M.mtx file"
        )
    data = _read(path)
    missing = [key for key in ("M", "K", "nodes") if key not in data]
    if missing:
        there = ", ".join(sorted(data)) or "nothing"
        raise ConfigurationError(
            f"{path.name}: no {' and no '.join(missing)} in it; a structure has M, K and nodes, the file has {there}"
        )
    mass, stiffness, nodes = data["M"], data["K"], np.asarray(data["nodes"])
    if nodes.dtype.kind not in "fiu" or nodes.ndim != 2 or nodes.shape[1] != 3:
        raise ConfigurationError(
            f"{path.name}: nodes has shape {nodes.shape}; give one row of three coordinates a node"
        )
    structure = Structure(mass, stiffness, nodes, name=path.name)
    if units == "mm_t_s":
        structure = _from_millimetres(structure)
    _check_size(structure, path.name)
    return structure


def write_structure(path: Path, structure: Structure) -> None:
    """Write a structure so that `read_structure` gives it back, in the format of the suffix.

    Parameters
    ----------
    path
        A `.npz`, `.mat` or `_M.mtx` file.
    structure
        What to write.
    """
    matrices = {"M": structure.mass, "K": structure.stiffness}
    if path.suffix == ".npz":
        arrays: dict[str, Any] = {"nodes": structure.nodes}
        for key, matrix in matrices.items():
            if scipy.sparse.issparse(matrix):
                entries = scipy.sparse.coo_array(matrix)
                arrays |= {
                    f"{key}_row": entries.row,
                    f"{key}_column": entries.col,
                    f"{key}_value": entries.data,
                }
            else:
                arrays[key] = matrix
        np.savez(path, **arrays)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, matrices | {"nodes": structure.nodes})
    elif path.name.endswith(_SUFFIX):
        for key, value in (matrices | {"nodes": structure.nodes}).items():
            scipy.io.mmwrite(_beside(path, key), value, precision=17, symmetry="general")
    else:
        raise ConfigurationError(_unknown(path))


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.suffix == ".npz":
            return _npz(path)
        if path.suffix == ".mat":
            return {k: v for k, v in scipy.io.loadmat(path).items() if not k.startswith("__")}
        if path.name.endswith(_SUFFIX):
            files = {key: _beside(path, key) for key in ("M", "K", "nodes")}
            return {key: read_matrix_market(file) for key, file in files.items() if file.is_file()}
    except NotImplementedError as error:
        raise ConfigurationError(
            f"{path.name}: this MATLAB version is not read ({error}); save with the option -v7"
        ) from error
    except _DAMAGED as error:
        raise ConfigurationError(
            f"{path.name}: cannot be read: {' '.join(str(error).split())}; is it complete, and of numbers only?"
        ) from error
    raise ConfigurationError(_unknown(path))


def _npz(path: Path) -> dict[str, Any]:
    """Read arrays without pickle; row, column, value become one sparse matrix."""
    with path.open("rb") as file:  # numpy leaves the file open where the archive is damaged
        archive = np.load(file, allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise ValueError("it is one array, not an archive of several")
        data = {key: archive[key] for key in archive.files}
    if "nodes" in data:
        n = 6 * len(np.atleast_1d(data["nodes"]))
        for key in ("M", "K"):
            parts = [data.pop(f"{key}_{part}", None) for part in ("value", "row", "column")]
            if all(part is not None for part in parts):
                value, row, column = parts
                data[key] = scipy.sparse.coo_array((value, (row, column)), shape=(n, n)).tocsr()
    return data


def _beside(path: Path, key: str) -> Path:
    return path.with_name(f"{path.name.removesuffix(_SUFFIX)}_{key}.mtx")


def _unknown(path: Path) -> str:
    return f"finite elements: {path.name}: no format of this name is known; there are .npz, .mat and _M.mtx"


def _from_millimetres(structure: Structure) -> Structure:
    """Metres and kilograms from millimetres and tonnes: energies are in mJ, displacements in mm."""
    from robid_core.mechanics.flexible import Structure
    from robid_core.mechanics.flexible.structure import scaled

    per_unit = np.tile([1e3, 1e3, 1e3, 1.0, 1.0, 1.0], structure.n_node)
    mass, stiffness = (1e-3 * scaled(matrix, per_unit) for matrix in (structure.mass, structure.stiffness))
    return Structure(mass, stiffness, 1e-3 * structure.nodes, structure.name)


def _check_size(structure: Structure, name: str) -> None:
    extent = float(np.ptp(structure.nodes, axis=0).max())
    along_x = np.zeros(6 * structure.n_node)
    along_x[::6] = 1.0
    mass = float(along_x @ (structure.mass @ along_x))
    if not (_SMALLEST <= extent <= _LARGEST and mass <= _HEAVIEST):
        raise ConfigurationError(
            f"{name}: nodes span {extent:.4g} m and the mass is {mass:.4g} kg; no link is like that. Matrices and "
            "nodes are in N, m, kg - or is the file in millimetres and tonnes (units: mm_t_s)?"
        )
