"""How the hot loops are compiled: numba, kept on disk by content, compiled anew when anything they call has changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

import robid_core.compiled.collector  # noqa: F401 - it rests while kernels are compiled
from robid_core.compiled.machine_code import kept_by_content


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
    options["no_cfunc_wrapper"] = (
        True  # a way in from C, a twentieth of what there is to compile; nobody takes it
    )
    compiled: Any = numba.njit(**options)(function)
    kept_by_content(compiled)
    return compiled  # type: ignore[no-any-return]
