"""A reader of recordings (`robid.records`) whose every call on a file happens in the reading process."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np

from robid_core.errors import DataRejected, PluginError
from robid_core.foreign.disguise import disguise
from robid_core.foreign.process import read_apart
from robid_core.registered import check_registered
from robid_core.registry import RECORDS, Plugin, registry

READING = ("describe", "read", "read_record", "shapes", "units")


class GuardedReader:
    """What a reader can, under guard: `describe`, `read` and, where it has them, `read_record`, `shapes` and `units`.

    A damaged file is DataRejected whatever the library does with it; what the reader logs is logged here.
    """

    def __init__(self, plugin: Plugin, tell: bool = True) -> None:
        self._plugin, self._tell = plugin, tell
        self._reader = plugin.load()  # says what is not installed
        check_registered(plugin, self._reader)

    def quiet(self) -> GuardedReader:
        """Return a reader of the same files whose logs are not passed on: who reads twice is told once."""
        return GuardedReader(self._plugin, tell=False)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._reader, name)
        return functools.partial(self._call, name) if name in READING else found

    def _call(self, method: str, path: Path) -> Any:
        try:
            result = read_apart(path, self._plugin.target, method, self._plugin.name, tell=self._tell)
        except DataRejected as error:
            if other := disguise(path, self._plugin.name):
                raise DataRejected(f"{path}: this is {other}") from error
            raise
        if method == "read":
            _check_columns(result, self._plugin)
        return result


def _check_columns(result: Any, plugin: Plugin) -> None:
    """Raise PluginError where a reader gave no columns of numbers."""
    for name, values in result.items() if isinstance(result, dict) else [("", None)]:
        if not (isinstance(name, str) and isinstance(values, np.ndarray) and values.dtype == np.float64):
            raise PluginError(
                f"R12: reader {plugin} gave {name or 'no mapping'}, which is no array of float64"
            )


def guarded_reader(name: str) -> GuardedReader:
    """Return the reader of recordings of this name, or pinned as `distribution:name`, under guard.

    Raises ConfigurationError where there is none, PluginError where it cannot be imported or is no reader.

    >>> import robid_core as robid
    >>> type(robid.guarded_reader(robid.record_readers()["csv"])).__name__
    'GuardedReader'
    """
    return GuardedReader(registry().find(RECORDS, name))
