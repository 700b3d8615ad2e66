"""One task as it travels: bytes there, bytes back, computed by the same code with one thread.

Function and arguments are packed as they are for a process of this machine, so that a worker sees the same copies;
a function goes by its name, never by its code. What a task raises comes back as a value: whatever dask itself raises
is then dask's.
"""

from __future__ import annotations

import importlib
import pickle
import platform
from collections.abc import Callable
from typing import Any

from robid_core import PluginError, __version__

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")  # another version may give another last digit


def packed(function: Callable[..., Any], argument: tuple[Any, ...]) -> bytes:
    """Return a task as bytes.

    Raises PluginError where another machine could not find the function by its name.
    """
    found: Any = None
    try:
        found = importlib.import_module(function.__module__)
        for part in function.__qualname__.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError):
        found = None
    if found is not function or function.__module__ == "__main__":
        raise PluginError(
            f"{task_name(function)} cannot be a parallel task: it must be a function at the top of an importable module"
        )
    return pickle.dumps((function, argument), protocol=pickle.HIGHEST_PROTOCOL)


def task_name(function: Callable[..., Any]) -> str:
    """Return module and name of a function, for messages."""
    return f"{getattr(function, '__module__', '?')}.{getattr(function, '__qualname__', repr(function))}"


def versions() -> dict[str, str]:
    """Say which code computes here."""
    found = {"python": platform.python_version(), "robid": __version__}
    return {**found, **{name: importlib.import_module(name).__version__ for name in LIBRARIES}}


def compute(task: bytes, expected: dict[str, str]) -> tuple[str, bytes]:
    """Compute a packed task on a worker: ("done", result), ("raised", exception) or ("refused", reason as text)."""
    import numba
    from threadpoolctl import threadpool_limits

    here = versions()
    if here != expected:
        other = ", ".join(
            f"{name} {here[name]} and not {expected[name]}" for name in here if here[name] != expected[name]
        )
        return "refused", f"it has {other}".encode()
    try:
        function, argument = pickle.loads(task)
    except Exception as error:
        return "refused", f"it cannot import the task: {type(error).__name__}: {error}".encode()
    if numba.config.NUMBA_NUM_THREADS > 1:
        numba.set_num_threads(1)
    try:
        with threadpool_limits(limits=1):
            result = function(*argument)
        return "done", pickle.dumps(result, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return "raised", _packed_exception(error)


def _packed_exception(error: Exception) -> bytes:
    try:
        data = pickle.dumps(error, protocol=pickle.HIGHEST_PROTOCOL)
        pickle.loads(data)  # some exceptions can be packed and not unpacked
        return data
    except Exception:
        return pickle.dumps(PluginError(f"{type(error).__name__}: {error}"), protocol=pickle.HIGHEST_PROTOCOL)
