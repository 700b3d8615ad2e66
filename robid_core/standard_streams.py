"""What is shown ends nothing: standard streams that lose what cannot be written, as on a full disk or a closed pipe.

Every layer above - print, typer, rich, logging, warnings - writes through the raw stream, so that one is replaced.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path
from typing import Any, Literal

NUMBER = {"stdout": 1, "stderr": 2}


class _Lossy(io.FileIO):
    """A raw stream whose writes always succeed."""

    matters = False  # whether what is written is what the command was for
    lost: OSError | None = None  # why something was lost first

    def write(self, data: Any, /) -> int:
        """Write what can be written; lose the rest."""
        try:
            super().write(data)
        except OSError as error:
            self.lost = self.lost or error
        return len(memoryview(data).cast("B"))


def open_closed_streams() -> None:
    """Open the null device where a standard stream was closed from the start.

    Else the next file that is opened takes its number, and what is meant for a person goes into it.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # takes the lowest free number


def never_failing(name: Literal["stdout", "stderr"], matters: bool = False) -> None:
    """Replace a standard stream of this process by one that never raises; one that is somebody's own stays.

    Where what is written `matters`, `lost_on_the_way` tells afterwards; called again, only that is set anew.
    """
    stream = getattr(sys, name)
    if stream is None:  # it was closed when Python started
        setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        return
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)  # there is no buffer under python -u
    if isinstance(raw, _Lossy):
        raw.matters = matters
    if type(raw) is not io.FileIO or raw.fileno() != NUMBER[name]:
        return
    with contextlib.suppress(OSError, ValueError):
        stream.flush()
    lossy = _Lossy(NUMBER[name], "wb", closefd=False)
    lossy.matters = matters
    replacement = io.TextIOWrapper(
        lossy if raw is buffer else io.BufferedWriter(lossy),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    setattr(sys, name, replacement)
    setattr(sys, f"__{name}__", replacement)  # Python flushes this one when it ends


def lost_on_the_way(name: Literal["stdout", "stderr"]) -> OSError | None:
    """Return why something that matters did not get through; None where all did, or nobody listens.

    Who closes a pipe, as `head -1` does, wanted no more.
    """
    stream = getattr(sys, name)
    stream.flush()
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)
    error = raw.lost if isinstance(raw, _Lossy) and raw.matters else None
    return None if isinstance(error, BrokenPipeError) else error
