"""How the machine code of kernels is kept on disk: nothing is spoilt by processes that compile at once, or are killed.

Numba writes the index of a kernel first and its machine code after, under a number that the next one may get too. In
between, the stamp of today's sources stands over the code of yesterday's: another process computes with that, and
after a kill there every process does, for good. Two processes that add different signatures may write both codes to
one file. Here the code is written first, to a file named by its content, then the index, by one process at a time.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def keep_safely(cache_file: Any) -> None:
    """Let a numba `IndexDataCacheFile` write code before index, under a lock, and outlive types that are moved.

    Raises AttributeError where this numba has no such parts.
    """
    for part in ("_cache_path", "_index_name", "_load_index", "_save_index", "_dump", "_open_for_write"):
        getattr(cache_file, part)
    cache_file.save = functools.partial(_save, cache_file)
    cache_file._load_index = functools.partial(_load_index, cache_file)


def _load_index(cache_file: Any) -> dict[Any, str]:
    """Read which signatures are kept; none where the index names a type that is no more, as after an upgrade."""
    try:
        found: dict[Any, str] = type(cache_file)._load_index(cache_file)
    except (ImportError, AttributeError):
        return {}
    return found


def _save(cache_file: Any, key: Any, data: Any) -> None:
    """Add the machine code of one signature, and remove what no index names any more."""
    folder, base = Path(cache_file._cache_path), cache_file._index_name.removesuffix("nbi")
    code = cache_file._dump(data)
    name = f"{base}{hashlib.sha256(code).hexdigest()[:32]}.nbc"
    with _alone(folder / f"{base}lock"):
        with cache_file._open_for_write(folder / name) as file:
            file.write(code)
        codes = {**cache_file._load_index(), key: name}
        cache_file._save_index(codes)
        for path in folder.iterdir():
            if path.name.startswith(base) and path.suffix == ".nbc" and path.name not in codes.values():
                path.unlink(missing_ok=True)  # who is about to read it compiles instead


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Wait until no other process holds this file's lock; a killed process holds none."""
    with path.open("a") as file:
        with contextlib.suppress(OSError):  # a file system without locks: rarely two at the same instant
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
