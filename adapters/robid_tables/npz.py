"""NumPy archives (.npz) as named arrays; nothing pickled is ever opened."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np

from robid_core import DataRejected, FloatArray


def read_arrays(path: Path) -> dict[str, FloatArray]:
    """Return every real numeric array of the archive; arrays of text are left out.

    Raises
    ------
    DataRejected
        If the file is no archive, is damaged, or holds Python objects (which could run code when opened).
    """
    arrays: dict[str, FloatArray] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
            for name in names:
                with archive.open(name) as member:
                    values = np.lib.format.read_array(member, allow_pickle=False)
                if values.dtype.kind in "fiub":
                    arrays[name.removesuffix(".npy")] = values.astype(np.float64)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise DataRejected(f"{path}: no intact NumPy archive ({error})") from error
    except ValueError as error:
        hint = "; save plain arrays, not Python objects" if "pickle" in str(error).lower() else ""
        raise DataRejected(f"{path}: {name} cannot be read ({error}){hint}") from error
    if not arrays:
        raise DataRejected(f"{path}: the archive holds no numeric array")
    return arrays


class NpzRecords:
    """Reader of NumPy archives, registered as `npz` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return one line for each array."""
        return [f"{name}: {values.shape}" for name, values in read_arrays(path).items()]

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the arrays by name."""
        return read_arrays(path)
