"""The seal of an artifact's file: 80 bytes behind its HDF5 that say what all before them hashes to.

HDF5 knows where it ends and does not look behind that; MATLAB, Julia and h5py open a sealed file as any other. A file
that is hashed before HDF5 sees it can neither crash nor mislead it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from robid_core.errors import StoreError

MARK = b"robid sha256 is "
LENGTH = len(MARK) + 64
BLOCK = 1 << 20


def of(content: bytes) -> bytes:
    """Return the seal of a content."""
    return MARK + hashlib.sha256(content).hexdigest().encode()


def is_intact(path: Path) -> bool:
    """Tell whether a file is sealed; StoreError where it is not what was sealed, or cannot be read."""
    try:
        left = path.stat().st_size - LENGTH
        if left < 0:
            return False
        digest = hashlib.sha256()
        with path.open("rb") as file:
            file.seek(left)
            found = file.read()
            if not found.startswith(MARK):
                return False
            file.seek(0)
            while left > 0 and (block := file.read(min(left, BLOCK))):
                digest.update(block)
                left -= len(block)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror or error}") from error
    if found != MARK + digest.hexdigest().encode():
        raise StoreError(
            f"{path}: damaged: its bytes are not those that were sealed; bring it back from a copy, "
            "or make it again with robid run"
        )
    return True
