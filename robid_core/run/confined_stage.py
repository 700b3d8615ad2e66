"""A stage's own process, from the inside: it runs the stage and tells through a pipe; `confine.py` is the other end."""

from __future__ import annotations

import contextlib
import faulthandler
import logging
import logging.handlers
import multiprocessing
import os
import queue
import re
import resource
import signal
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from robid_core.artifacts import Artifact
from robid_core.errors import PluginError
from robid_core.executors import one_thread
from robid_core.executors.task import surviving
from robid_core.interruption import (
    SIGNALS,
    heed,
    held,
    out_of_processor_time,
    settled,
    signals_as_interrupt,
)
from robid_core.run.arguments import arguments_of
from robid_core.run.guard import checked_result
from robid_core.run.log import NAME
from robid_core.stage import Stage
from robid_core.standard_streams import never_failing
from robid_core.store import Files, failures_named


@dataclass(frozen=True)
class Job:
    """A stage and what it takes, so that another process can run it."""

    name: str
    plugin: str  # name, distribution and version, for messages
    stage: Stage
    artifacts: Mapping[str, list[tuple[type[Artifact], Path]]]  # by parameter
    lent: Mapping[str, Any]  # by parameter; the Context is made over there
    context: tuple[str, int, Path, Path] | None  # parameter, seed of the pipeline, data root, scratch
    executor: tuple[Callable[..., Any], Mapping[str, Any]]
    result: Path
    has_drives: bool = False  # then it is asked to end before it is killed
    told: tuple[str, tuple[str, ...]] = ("", ())  # name of the run and warnings, of a report


def crash_file(job: Job) -> Path:
    """Return where the process of a stage leaves its last words when its code crashes."""
    return job.result.with_name(f"{job.result.name}.crash")


def last_frame(file: Path) -> str:
    """Return the place of a crash in words, " at stage.py:12, in run"; empty where the file does not tell it."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    found = re.search(r'\(most recent call first\):\n  File "(.*)", line (\d+) in (.*)', text)
    return f" at {found[1]}:{found[2]}, in {found[3]}" if found else ""


class _Line:
    """What is told, a whole message at a time, from whichever thread."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._lock = pipe, threading.Lock()

    def send(self, *message: Any) -> None:
        """Tell it; half a message would be none, so signals wait."""
        with held(), self._lock:
            self._pipe.send(message)


class _Log(logging.handlers.QueueHandler):
    """Sends what is logged to the run, which writes it down."""

    def __init__(self, line: _Line) -> None:
        super().__init__(queue.SimpleQueue())
        self._line = line

    def enqueue(self, record: logging.LogRecord) -> None:
        """Send a record whose message is complete; where the stage's code closed the pipe, that is told by its end."""
        with contextlib.suppress(OSError):
            self._line.send("log", record)

    def handleError(self, record: logging.LogRecord) -> None:
        """Lose a line that cannot be made or sent, as the log file does."""


def run_job(
    job: Job, memory_mb: int | None, environment: Mapping[str, str], umask: int, pipe: Connection
) -> None:
    """Run a stage in this process, which was started for it, and tell how it went."""
    os.setsid()  # a process group of its own, which ends as a whole
    os.set_inheritable(
        pipe.fileno(), False
    )  # another program in its place would hold the line and say nothing
    _take_over(environment, umask)
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    never_failing("stdout")
    never_failing("stderr")
    line = _Line(pipe)
    with signals_as_interrupt(), crash_file(job).open("w", encoding="utf-8") as crash:
        faulthandler.enable(crash, all_threads=False)
        try:
            line.send("begun")
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
            _work(job, memory_mb, line)
            message: tuple[Any, ...] = ("done",)
        except BaseException as error:
            settled()
            why = out_of_processor_time() if isinstance(error, KeyboardInterrupt) else ""
            message = _told(_out_of_time(job, why) if why else error)
        try:
            line.send(*message)
        except OSError:  # nobody listens any more, or the stage's code closed the pipe and all other files
            os._exit(1)


def _out_of_time(job: Job, why: str) -> PluginError:
    return PluginError(
        f"stage {job.name}: {job.plugin}: R11: {why}; nothing was stored; raise the limit, or give it less work"
    )


def _told(error: BaseException) -> tuple[Any, ...]:
    """Return the message on an error; end with exit code 1 where the stage's code left too little of Python for it."""
    try:
        text = traceback.format_exc()
        told = surviving(error)
        with contextlib.suppress(Exception):  # some exceptions let nobody add to them
            told.robid_frames = list(traceback.extract_tb(error.__traceback__))  # type: ignore[attr-defined]
        return "error", told, text
    except BaseException:
        os._exit(1)


def _take_over(environment: Mapping[str, str], umask: int) -> None:
    """Take what the run has now: a server has what the run of its first stage had."""
    os.environ.clear()
    os.environ.update(environment)
    time.tzset()
    os.umask(umask)
    np.random.seed()  # noqa: NPY002  # who draws from it without a seed shall not draw what the stage before drew


def _work(job: Job, memory_mb: int | None, line: _Line) -> None:
    from robid_core.compiled.telling import compilation_told
    from robid_core.run.calling import make_context

    artifacts = {name: [kind.read(path) for kind, path in found] for name, found in job.artifacts.items()}
    if memory_mb is not None:  # on top of what libraries have mapped already
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        limit = taken + memory_mb * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    def progress(done: float, total: float, note: str = "") -> None:
        heed()
        line.send("progress", done, total, note)

    logger = logging.getLogger(NAME)
    logger.addHandler(_Log(line))
    logger.setLevel(logging.DEBUG)
    make, settings = job.executor
    with (
        one_thread(),
        make(**settings) as tasks,
        compilation_told(lambda kernel: line.send("compiling", kernel)),
    ):
        log = logging.getLogger(f"{NAME}.{job.name}")
        arguments: dict[str, Any] = {**arguments_of(job.stage, artifacts, log), **job.lent}
        if job.context is not None:
            parameter, seed, data_root, scratch = job.context
            arguments[parameter] = make_context(
                job.name, seed, data_root, tasks, progress, scratch, *job.told
            )
        result = checked_result(job.name, job.plugin, job.stage, job.stage.run(**arguments))
    with failures_named("write", job.result):
        Files().write(job.result, result.write)


def _end_with(parent: Any) -> None:
    parent.join()
    os.killpg(os.getpgid(0), signal.SIGKILL)
