"""How the hot loops are compiled: numba, cached on disk, recompiled when anything they call has changed.

Numba keys a cached kernel by the source of the file it stands in, not by the kernels it calls from other
files: after an edit there, the cached kernel returns wrong numbers silently. `kernel` therefore folds the
stamps of every compiled function that is named in the body into the stamp of the caller.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.extending import is_jitted

from robid_core.compiled.machine_code import keep_safely

_TYPES = [
    (stat.st_mtime, stat.st_size)
    for stat in (Path(__file__).with_name(name).stat() for name in ("lanes.py", "views.py", "functions.py"))
]
"""Stamps of the types and overloads that kernels are compiled with: no function names them."""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, without the interpreter lock, and keep the machine code on disk.

    Every operation rounds as written: a number comes out the same on one lane and on eight. Callers hand in
    C-contiguous, writable float64 and int64 arrays only, so that there is one signature.
    """
    return _compiled(function, fastmath=False)


def fused_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """As `kernel`, but a product and a sum may be one operation, which is faster.

    What the compiler fuses may differ between one lane and eight: each use has a test that it does not.
    """
    return _compiled(function, fastmath={"contract"})


def _compiled(function: Callable[..., Any], fastmath: Any) -> Callable[..., Any]:
    options: dict[str, Any] = {"nogil": True, "fastmath": fastmath, "error_model": "numpy"}
    compiled: Any = numba.njit(cache=True, **options)(function)
    try:
        caches = [called._cache._cache_file for called in _called_kernels(function)]
        own: Any = compiled._cache._cache_file
        keep_safely(own)
        own._source_stamp = (own._source_stamp, *_TYPES, *(cache._source_stamp for cache in caches))
    except AttributeError:
        # A numba that keeps its stamps elsewhere: compile anew in every process, slow but right.
        compiled = numba.njit(**options)(function)
    return compiled  # type: ignore[no-any-return]


def _called_kernels(function: Callable[..., Any]) -> list[Any]:
    """Compiled functions that are named in the body of a function."""
    named = (function.__globals__.get(name) for name in function.__code__.co_names)
    return [thing for thing in named if thing is not None and is_jitted(thing)]
