"""File calls of Python that fail, below one folder: counted, and from the n-th on refused by the system's own error.

Patches the process it is called in, for good: for a process that was forked to be attacked. Calls of C libraries that
open their files themselves are not met; a small file system (`attacks.py --full`) meets those as well.
"""

from __future__ import annotations

import builtins
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

WRITING = (
    "write",
    "replace",
    "rename",
    "link",
    "symlink",
    "mkdir",
    "rmdir",
    "unlink",
    "chmod",
    "fsync",
    "truncate",
)
READING = ("stat", "lstat", "scandir", "listdir", "open")


class FailingCalls:
    """The n-th call below a folder raises an error, or every call from the n-th on; 0 fails none, and counts."""

    def __init__(self, folder: Path, failing: int, number: int, for_ever: bool) -> None:
        self.folder = os.path.realpath(folder)
        self.failing, self.number, self.for_ever = failing, number, for_ever
        self.count = 0
        self.failed: list[str] = []

    def install(self) -> None:
        """Put itself in the place of the calls of `os` and of `open`."""
        for name in (*WRITING, *READING):
            setattr(os, name, self._failing(name, getattr(os, name)))
        real_open = io.open

        def opened(file: Any, mode: str = "r", buffering: int = -1, *rest: Any, **named: Any) -> Any:
            if not self._below((file,)):
                return real_open(file, mode, buffering, *rest, **named)
            self._call("open", file)
            if ("r" in mode and "+" not in mode) or named.get("opener") or buffering == 0:
                return real_open(file, mode, buffering, *rest, **named)
            raw = _FailingRaw(file, mode.replace("b", "").replace("t", ""), self._call)
            whole = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
            if "b" in mode:
                return whole
            text = dict(zip(("encoding", "errors", "newline"), rest, strict=False)) | named
            return io.TextIOWrapper(whole, text.get("encoding"), text.get("errors"), text.get("newline"))

        io.open = builtins.open = opened

    def _failing(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if self._below(arguments):
                self._call(name, arguments[0])
            return real(*arguments, **named)

        return call

    def _call(self, name: str, place: Any) -> None:
        """Count a call, and fail where its turn has come."""
        self.count += 1
        if self.failing and (self.count == self.failing or (self.for_ever and self.count > self.failing)):
            self.failed.append(name)
            raise OSError(self.number, os.strerror(self.number), None if isinstance(place, int) else place)

    def _below(self, arguments: tuple[Any, ...]) -> bool:
        """Tell whether a call's first or second argument lies below the folder; a number is an open file."""
        return any(self._is_below(argument) for argument in arguments[:2])

    def _is_below(self, place: Any) -> bool:
        if isinstance(place, bool) or not isinstance(place, (int, str, os.PathLike)):
            return False
        if isinstance(place, int):
            try:
                path = str(Path(f"/proc/self/fd/{place}").readlink())
            except OSError:
                return False
        else:
            path = os.path.abspath(place)  # noqa: PTH100  links are not followed: what they lead to is another file
        return path == self.folder or path.startswith(self.folder + os.sep)


class _FailingRaw(io.FileIO):
    """A file that is written; each write is a call that may fail."""

    def __init__(self, file: Any, mode: str, call: Callable[[str, Any], None]) -> None:
        super().__init__(file, mode)
        self._call = call

    def write(self, content: Any, /) -> int | None:
        self._call("write", self.name)
        return super().write(content)
