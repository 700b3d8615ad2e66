"""How the machine code of kernels is kept on disk: by content, for all installations of a user.

Every kernel has a folder, named by the hash of everything that decides what it computes (`content`). A second
environment with the same sources and the same compiler finds what the first one compiled; other versions stand beside
it. A few are kept.

Numba writes the index of a kernel first and its machine code after, under a number that the next one may get too. Two
processes that add different signatures may then write both codes to one file, and after a kill an index may name a
code that is not its own. Here the code is written first, to a file named by its content, then the index, by one
process at a time.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import os
import pickle
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

from numba.core import caching

from robid_core.compiled.content import keep_hash

VERSIONS = 4
"""Contents of a kernel that are kept: installations of different versions beside one another, and edited sources."""


@functools.cache
def cache_folder(what: str) -> Path:
    """Folder for compiled `kernels` or `laws`: below numba's cache folder where one is set, else the user's."""
    for folder in _possible_folders(what):
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError:
            continue
        if os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid():
            return folder
    return Path(tempfile.mkdtemp(prefix=f"robid-{what}-"))


def _possible_folders(what: str) -> Iterator[Path]:
    if caches := os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME"):
        yield Path(caches) / "robid" / what
    else:
        with contextlib.suppress(RuntimeError):  # a user without a home, as in a container
            yield Path.home() / ".cache" / "robid" / what
    yield Path(tempfile.gettempdir()) / f"robid-{what}-{os.getuid()}"


def kept_by_content(compiled: Any) -> None:
    """Let a function that numba compiles keep its machine code, and find that of an equal one.

    A numba that has other parts keeps nothing: compiled anew in every process, slow but right.
    """
    for part in ("_load_index", "_save_index", "_dump", "_open_for_write", "_load_data"):
        if not hasattr(caching.IndexDataCacheFile, part):
            return
    with contextlib.suppress(AttributeError):
        compiled._cache = _Cache(compiled.py_func)


def is_kernel(compiled: Any) -> bool:
    """Tell whether the machine code of a compiled function is kept by content."""
    return isinstance(compiled._cache, _Cache)


def kept_codes(compiled: Any) -> int:
    """Count the signatures of a kernel whose machine code is on disk."""
    return len(compiled._cache._cache_file._load_index()) if is_kernel(compiled) else 0


class _Locator(caching._CacheLocator):  # type: ignore[misc]
    """Where numba keeps the machine code of one function."""

    def __init__(self, function: FunctionType) -> None:
        self._hash = keep_hash(function)
        self._py_file = function.__code__.co_filename  # numba names it in warnings
        self._folder = (
            cache_folder("kernels") / f"{function.__module__}.{function.__qualname__}" / self._hash[:32]
        )

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return self._hash

    def get_disambiguator(self) -> str:
        return "kernel"


class _Implementation(caching.CompileResultCacheImpl):  # type: ignore[misc]
    """How numba turns a compiled function into bytes; only the place is ours."""

    _locator_classes = ()

    def __init__(self, function: FunctionType) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function)
        self._filename_base = "kernel"


class _Cache(caching.FunctionCache):  # type: ignore[misc]
    """Numba's cache of one function; a full disk or a damaged file is no error: the function is compiled."""

    _impl_class = _Implementation

    def __init__(self, function: FunctionType) -> None:
        super().__init__(function)
        self._cache_file = _Files(self._cache_path, "kernel", self._impl.locator.get_source_stamp())

    def _save_overload(self, sig: Any, data: Any) -> None:
        with contextlib.suppress(OSError):
            super()._save_overload(sig, data)


class _Files(caching.IndexDataCacheFile):  # type: ignore[misc]
    """Index and machine codes of one function."""

    def save(self, key: Any, data: Any) -> None:
        """Add the machine code of one signature, and remove what no index names any more."""
        folder, code = Path(self._cache_path), self._dump(data)
        name = f"{_hash(code)}.nbc"
        with _alone(folder / "lock"):
            with self._open_for_write(folder / name) as file:
                file.write(code)
            codes = {**self._load_index(), key: name}
            self._save_index(codes)
            for path in folder.glob("*.nbc"):
                if path.name not in codes.values():
                    path.unlink(missing_ok=True)  # who is about to read it compiles instead
        _forget_old(folder)

    def _load_index(self) -> dict[Any, str]:
        """Read which signatures are kept; none where the index is damaged, or names a type that is no more."""
        with contextlib.suppress(*_DAMAGED):
            found: dict[Any, str] = super()._load_index()
            return found
        return {}

    def _load_data(self, name: str) -> Any:
        """Read one machine code; None where it is not what was written."""
        code = Path(self._cache_path, name).read_bytes()
        if f"{_hash(code)}.nbc" != name:
            return None
        with contextlib.suppress(*_DAMAGED):
            return pickle.loads(code)
        return None


_DAMAGED = (
    *(ImportError, AttributeError, EOFError, ValueError, KeyError, IndexError, TypeError, OSError),
    pickle.PickleError,
)


def _hash(code: bytes) -> str:
    return hashlib.sha256(code).hexdigest()[:32]


def _forget_old(folder: Path) -> None:
    """Remove what was compiled of this kernel longest ago."""
    with contextlib.suppress(OSError):  # another process removes the same
        versions = sorted(folder.parent.iterdir(), key=lambda path: path.stat().st_mtime)
        for path in versions[:-VERSIONS]:
            shutil.rmtree(path)


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Wait until no other process holds this file's lock; a killed process holds none."""
    with path.open("a") as file:
        with contextlib.suppress(OSError):  # a file system without locks: rarely two at the same instant
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
