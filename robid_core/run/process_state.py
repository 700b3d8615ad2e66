"""What a stage changes of the process that it runs in is taken back after it, and told (R16).

A stage in a process of its own (`confine.py`) leaves nothing behind. This is for those that share the run's: robid's
own, stages that move hardware, and third parties' under `--trust-plugins`. Threads cannot be taken back; those that
are still there are told.
"""

from __future__ import annotations

import contextlib
import locale
import logging
import os
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import ThreadpoolController


class _Part(NamedTuple):
    """Something that a process has once, how it is asked for, and how it is set."""

    ask: Callable[[], Any]
    put: Callable[[Any], object]


def umask() -> int:
    """Return the umask of this process."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _folder() -> str:
    try:
        return str(Path.cwd())
    except FileNotFoundError:  # somebody removed it
        return ""


def _put_folder(path: str) -> None:
    if path:
        with contextlib.suppress(FileNotFoundError):  # somebody moved or removed it: no stage's doing
            os.chdir(path)


def _put_environment(variables: Mapping[str, str]) -> None:
    for name in [name for name in os.environ if name not in variables]:
        del os.environ[name]
    os.environ.update(variables)


def _put_warning_filters(filters: list[Any]) -> None:
    warnings.filters[:] = filters  # type: ignore[index]
    warnings._filters_mutated()  # type: ignore[attr-defined]


FILTERS = "filters of warnings"
PARTS = {
    "numpy's error mode": _Part(np.geterr, lambda mode: np.seterr(**mode)),
    "umask": _Part(umask, os.umask),
    "working folder": _Part(_folder, _put_folder),
    "locale": _Part(
        lambda: locale.setlocale(locale.LC_ALL), lambda name: locale.setlocale(locale.LC_ALL, name)
    ),
    "environment variables": _Part(lambda: dict(os.environ), _put_environment),
    FILTERS: _Part(lambda: list(warnings.filters), _put_warning_filters),
}


def _only_added_by_imports(before: list[Any], now: list[Any]) -> bool:
    """Tell whether filters of some warnings were added, as packages do that are imported; none of all warnings."""
    added = len(now) - len(before)
    return now[added:] == before and all(
        message or module or category is not Warning for _, message, category, module, _ in now[:added]
    )


@contextlib.contextmanager
def state_taken_back(log: logging.Logger) -> Iterator[None]:
    """Leave this process as it was found, however what is done inside ends; what was changed is logged."""
    before = {name: part.ask() for name, part in PARTS.items()}
    threads, libraries = set(threading.enumerate()), ThreadpoolController()
    counts = {info["filepath"]: info["num_threads"] for info in libraries.info()}
    try:
        yield
    finally:
        changed = [name for name, part in PARTS.items() if part.ask() != before[name]]
        told = list(changed)
        for name in changed:
            now = PARTS[name].ask()
            PARTS[name].put(before[name])
            if name == FILTERS and _only_added_by_imports(before[name], now):
                told.remove(name)
        for library in libraries.lib_controllers:
            if library.num_threads != counts[library.filepath]:
                library.set_num_threads(counts[library.filepath])
                told.append(f"threads of {library.internal_api}")
        if told:
            log.warning("R16: it changed %s of the run's process; taken back", ", ".join(told))
        left = [
            thread.name for thread in threading.enumerate() if thread not in threads and not thread.daemon
        ]
        if left:
            log.warning(
                "R16: it left threads running, which go on beside the next stages: %s", ", ".join(left)
            )
