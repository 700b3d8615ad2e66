"""The process that reads: takes requests from its standard input, one after the other, and answers on its output.

It limits itself before a library sees the file. Timers end it by their signals' default action, which needs no Python:
a library that loops in C ends all the same, also where the parent has gone. What libraries print goes nowhere; what
they log goes back with the answer. It ends when nobody can ask any more.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import logging
import os
import resource
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from robid_core.errors import RobidError
from robid_core.foreign.limits import Limits

Told = list[tuple[str, int, str]]  # logger, level, message


@dataclass(frozen=True)
class Request:
    """Which function of which object reads which file: `target` as in an entry point, `method` empty for itself.

    `folder` is where relative paths begin, `search` where Python looks for modules.
    """

    target: str
    method: str
    path: Path
    folder: str
    search: tuple[str, ...]
    limits: Limits


@dataclass(frozen=True)
class Answer:
    """`state` is done, refused (an error of ours), memory, system (an OSError with its number) or failed."""

    state: str
    result: Any = None
    told: Told | None = None
    trace: str = ""


class _Collector(logging.Handler):
    def __init__(self, told: Told) -> None:
        super().__init__(logging.INFO)
        self._told = told

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message as text."""
        self._told.append((record.name, record.levelno, record.getMessage()))


def main() -> None:
    """Answer until the standard input ends."""
    requests, answers = Connection(os.dup(0), writable=False), Connection(os.dup(1), readable=False)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(nowhere, descriptor)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for number in (signal.SIGALRM, signal.SIGPROF, signal.SIGPIPE):
        signal.signal(number, signal.SIG_DFL)
    warnings.simplefilter("ignore")
    while True:
        try:
            request: Request = requests.recv()
        except EOFError:
            return
        answer = answered(request)
        try:
            answers.send(answer)
        except (TypeError, AttributeError, ValueError, MemoryError) as error:  # it cannot be sent as it is
            answers.send(Answer("failed", f"{type(error).__name__}: {error}"))


def answered(request: Request) -> Answer:
    """Return what a reader gave, or how it failed."""
    told: Told = []
    collector = _Collector(told)
    root = logging.getLogger()
    root.addHandler(collector)
    try:
        os.chdir(request.folder)
        sys.path[:] = request.search
        if request.target.partition(":")[0] not in sys.modules:
            importlib.invalidate_caches()  # it may have been installed since
        reader = EntryPoint("reader", request.target, "robid").load()
        function = getattr(reader, request.method) if request.method else reader
        with limited(request.limits):
            return Answer("done", function(request.path), told)
    except RobidError as error:
        return Answer("refused", error, told, traceback.format_exc())
    except MemoryError:
        return Answer("memory")
    except OSError as error:
        trace = traceback.format_exc()
        if error.errno == errno.ENOMEM:
            return Answer("memory")
        if error.errno is not None:
            return Answer("system", error.strerror or str(error), told, trace)
        return Answer("failed", _first_line(error), told, trace)
    except Exception as error:
        return Answer("failed", _first_line(error), told, traceback.format_exc())
    finally:
        root.removeHandler(collector)


def _first_line(error: BaseException) -> str:
    return f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"[:300]


@contextlib.contextmanager
def limited(limits: Limits) -> Iterator[None]:
    """Limit memory and time of what is done within; time that is up ends this process."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    status = Path("/proc/self/statm")
    if status.exists():
        taken = int(status.read_text().split()[0]) * resource.getpagesize()
        most = taken + limits.memory_bytes
        if hard != resource.RLIM_INFINITY:  # a stage under --memory: less may be allowed already
            most = min(most, hard)
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    signal.setitimer(signal.ITIMER_PROF, limits.processor_s)
    signal.setitimer(signal.ITIMER_REAL, limits.clock_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
