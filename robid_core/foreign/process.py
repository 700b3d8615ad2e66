"""The process for files of others, from outside: started when it is first needed, asked, ended, and what its end means.

One for this process, kept for the next file: it takes half a second to start (Python, numpy and a library), and some
milliseconds a file then (`tests/fuzz/cost.py`). It is a session of its own, so that an interrupt at the keyboard is the
parent's; a parent that is interrupted while it waits ends it.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from robid_core.errors import DataRejected, StoreError
from robid_core.foreign.limits import Limits, limits_of, size_of
from robid_core.foreign.worker import Answer, Request
from robid_core.interruption import heed

LOOK_S = 0.05  # how often an interruption is looked at
GRACE_S = 10.0  # after which a process that did not end by its own timers is killed
GONE_S = 5.0
START = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from robid_core.foreign.worker import main; main()"
SURROUNDINGS = {  # one thread and one arena: address space is what is limited
    "MALLOC_ARENA_MAX": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
    "HDF5_USE_FILE_LOCKING": "FALSE",  # data folders may be read-only
}
REMEDY = "copy it again from where it was recorded, or export it anew"


class Worker:
    """One reading process and the pipes to it."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self._process = subprocess.Popen(
            [sys.executable, "-c", START, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **SURROUNDINGS},
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests = Connection(os.dup(self._process.stdin.fileno()), readable=False)
        self._answers = Connection(os.dup(self._process.stdout.fileno()), writable=False)
        self._process.stdin.close()
        self._process.stdout.close()

    @property
    def alive(self) -> bool:
        """Whether it can be asked, by this process."""
        return self.owner == os.getpid() and self._process.poll() is None

    def ask(self, request: Request) -> Answer | int:
        """Return the answer, or the exit code (negative: a signal) with which it died of the request."""
        latest = time.monotonic() + request.limits.clock_s + GRACE_S
        try:
            self._requests.send(request)
            while not self._answers.poll(LOOK_S):
                heed()
                if time.monotonic() > latest:
                    self.end()
                    return -signal.SIGALRM
            answer: Answer = self._answers.recv()
            return answer
        except (EOFError, OSError):
            self.end()
            return self._process.returncode
        except BaseException:
            self.end()
            raise

    def end(self) -> None:
        """End it, whatever it is doing; one that has died keeps its exit code."""
        if self.owner != os.getpid():
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._requests.close()
            self._process.wait(LOOK_S)
        self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(GONE_S)
        self._answers.close()


_lock = threading.Lock()
_kept: list[Worker] = []


def _end_kept() -> None:
    while _kept:
        _kept.pop().end()


atexit.register(_end_kept)


def _worker() -> Worker:
    """Return the process, started anew where it has died or belongs to the process that this one was forked from."""
    if not _kept or not _kept[0].alive:
        _end_kept()
        _kept.append(Worker())
    return _kept[0]


def read_apart(
    path: Path, target: str, method: str, what: str, limits: Limits | None = None, tell: bool = True
) -> Any:
    """Return what a function makes of a file, called in the reading process.

    Parameters
    ----------
    path
        The file.
    target, method
        What is called: an object as an entry point names it, and its method (empty: the object itself).
    what
        As what the file is read, for messages: "MATLAB file".
    limits
        By default those of the file's size.
    tell
        Whether what the library logs is logged here.

    Raises
    ------
    DataRejected
        If the library crashes, needs too much memory or time, or fails in any way of its own.
    StoreError
        If the system cannot give the file.
    RobidError
        As the function raises it.
    """
    limits = limits or limits_of(path)
    request = Request(target, method, path, str(Path.cwd()), tuple(sys.path), limits)
    with _lock:
        try:
            worker = _worker()
        except OSError as error:
            raise StoreError(
                f"{path}: the process that reads files of others cannot be started ({error.strerror or error}); "
                "close some programs or raise the limits (ulimit), and run again"
            ) from error
        answer = worker.ask(request)
    if not isinstance(answer, Answer):
        raise DataRejected(f"{path}: {_death(answer, what, limits)}; {REMEDY}")
    for name, level, message in (answer.told or ()) if tell else ():
        logging.getLogger(name).log(level, "%s", message)
    if answer.state == "done":
        return answer.result
    if answer.state == "memory":
        raise DataRejected(
            f"A04: {path}: reading this file of {size_of(path) / 1e6:.3g} MB as {what} would need more than "
            f"{limits.memory_bytes / 1e6:.0f} MB: it is damaged, or packed beyond measure; {REMEDY}"
        )
    cause = RuntimeError(f"in the process that reads:\n{answer.trace}")
    if answer.state == "refused":
        raise answer.result from cause
    if answer.state == "system":
        raise StoreError(f"{path}: cannot be read ({answer.result})") from cause
    raise DataRejected(f"{path}: cannot be read as {what} ({answer.result}); {REMEDY}") from cause


def _death(code: int, what: str, limits: Limits) -> str:
    if code == -signal.SIGPROF:
        return f"reading it as {what} was not finished after {limits.processor_s:.0f} s of computing: it is damaged"
    if code == -signal.SIGALRM:
        return f"reading it as {what} was not finished after {limits.clock_s:.0f} s: it is damaged"
    if code == -signal.SIGKILL:
        return f"the system ended the process that read it as {what}, for memory: it is damaged, or too large"
    how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return f"the library that reads it as {what} crashed ({how}): it is damaged"
