"""A stage under a deadline or a memory limit: in a process group of its own that can be killed (R10, R11).

Only where it is asked for, and never for hardware: killing what moves a robot is for the drives' own
watchdogs. The stage gets the same inputs as in this process, read from the same files, and leaves its result
in a file; what it tells comes through a pipe.

The stage's process hears SIGTERM as a run hears Ctrl-C. One that has drives is asked to end first, so that they are
stopped and say how that went; then, and everything else at once, it is killed with its whole group.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import resource
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from robid_core.artifacts import Artifact
from robid_core.errors import MotionAborted, PluginError
from robid_core.interruption import SIGNALS, heed, held, settled, signals_as_interrupt
from robid_core.run.arguments import arguments_of
from robid_core.run.log import NAME
from robid_core.stage import Stage

LOG = logging.getLogger("robid.confine")
LOOK_S = 0.05  # how often deadline and interruption are looked at
STOPPING_S = 10.0  # what a process with drives may take to stop them
GONE_S = 5.0  # what the system may take to clear away a killed process
TellProgress = Callable[[float, float, str], None]


@dataclass(frozen=True)
class Job:
    """A stage and what it takes, so that another process can run it."""

    name: str
    stage: Stage
    artifacts: Mapping[str, list[tuple[type[Artifact], Path]]]  # by parameter
    lent: Mapping[str, Any]  # by parameter; the Context is made over there
    context: tuple[str, int, Path] | None  # parameter, seed of the pipeline, data root
    executor: tuple[Callable[..., Any], Mapping[str, Any]]
    result: Path
    has_drives: bool = False  # then it is asked to end before it is killed


def run_confined(job: Job, deadline_s: float | None, memory_mb: int | None, progress: TellProgress) -> None:
    """Run a stage in another process, which leaves the result at `job.result`.

    Raises whatever the stage raises; PluginError where it was killed at its deadline or died. Nothing here waits
    without limit, and KeyboardInterrupt ends the process too.
    """
    confined = _Confined(job, memory_mb)
    try:
        confined.start()
        confined.follow(deadline_s, progress)
    except BaseException as error:
        with held():
            told = confined.ask_to_stop()
            if told is not None and not isinstance(error, MotionAborted):
                raise told from error
        raise
    finally:
        with held():
            confined.end()


class _Confined:
    """The other process, seen from here."""

    def __init__(self, job: Job, memory_mb: int | None) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._job, self._memory_mb, self._begun = job, memory_mb, False
        self._here, self._there = spawn.Pipe(duplex=False)
        self._process = spawn.Process(
            target=_child, args=(job, memory_mb, self._there), name=f"robid {job.name}"
        )

    def start(self) -> None:
        """Start it deaf to signals until it has a process group of its own."""
        with held():
            resource_tracker.ensure_running()  # which would let signals through again
            with _blocked_signals():
                self._process.start()
            self._there.close()

    def follow(self, deadline_s: float | None, progress: TellProgress) -> None:
        """Pass on what it tells until it is done; raise its error, or PluginError at the deadline."""
        limit = None if deadline_s is None else time.monotonic() + deadline_s
        while True:
            heed()
            message = self._hear()
            if message is not None:
                if message[0] == "progress":
                    progress(*message[1:])
                elif message[0] == "error":
                    raise message[1] from RuntimeError(f"in the stage's own process:\n{message[2]}")
                elif message[0] == "done":
                    return
            elif limit is not None and time.monotonic() > limit:
                raise PluginError(
                    f"stage {self._job.name}: R10: not finished after {deadline_s:g} s, and killed with all its "
                    "processes; give it more time with --deadline, or less work"
                )

    def _hear(self, wait_s: float = LOOK_S) -> tuple[Any, ...] | None:
        """Return the next message, None where there is none within `wait_s`; whole, whatever signals come."""
        if not self._here.poll(wait_s):
            return None
        try:
            with held():
                message: tuple[Any, ...] = self._here.recv()
                self._begun = True
                return message
        except EOFError:
            raise self._died() from None

    def _died(self) -> PluginError:
        self._process.join(GONE_S)
        code = self._process.exitcode
        limit = f" (its limit was {self._memory_mb} MB)" if self._memory_mb else ""
        return PluginError(
            f"stage {self._job.name}: R11: its process died{f' with code {code}' if code is not None else ''}{limit}: "
            "killed by the system for memory, or its code crashed; give it less work or a larger --memory"
        )

    def ask_to_stop(self) -> MotionAborted | None:
        """Let a process with drives stop them, and return what went wrong with that; not for longer than STOPPING_S."""
        if not self._job.has_drives or self._process.pid is None:
            return None
        limit = time.monotonic() + STOPPING_S
        with contextlib.suppress(PluginError, OSError):  # it has ended
            if not self._begun and self._hear(0) is None:
                return None  # it is still loading: nothing can have moved
            os.kill(self._process.pid, signal.SIGTERM)
            while time.monotonic() < limit:
                message = self._hear() or ("nothing",)
                if message[0] == "error":
                    return message[1] if isinstance(message[1], MotionAborted) else None
                if message[0] == "done":
                    return None
        return None

    def end(self) -> None:
        """Kill it and its group, children and all; one that has finished is only collected."""
        if self._process.pid is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)  # no such group before it has called setsid
            self._process.kill()
            self._process.join(GONE_S)
            if self._process.exitcode is None:
                LOG.warning("process %d of stage %s does not end", self._process.pid, self._job.name)
        self._here.close()


@contextlib.contextmanager
def _blocked_signals() -> Iterator[None]:
    """Block signals in this thread; a process that is started now begins with them blocked."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _child(job: Job, memory_mb: int | None, pipe: Connection) -> None:
    os.setsid()  # a process group of its own, which ends as a whole
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with signals_as_interrupt():
        try:
            pipe.send(("begun",))
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
            _work(job, memory_mb, pipe)
            message: tuple[Any, ...] = ("done",)
        except BaseException as error:
            settled()
            text = traceback.format_exc()
            error.robid_frames = list(traceback.extract_tb(error.__traceback__))  # type: ignore[attr-defined]
            message = ("error", error, text)
        with held():
            _send(pipe, message)


def _send(pipe: Connection, message: tuple[Any, ...]) -> None:
    try:
        pipe.send(message)
    except BrokenPipeError:  # nobody listens any more
        pass
    except Exception:  # it cannot be sent as it is
        error = message[1]
        pipe.send(("error", PluginError(f"{type(error).__name__}: {error}"), message[2]))


def _work(job: Job, memory_mb: int | None, pipe: Connection) -> None:
    from robid_core.executors import one_thread
    from robid_core.run.calling import make_context

    artifacts = {name: [kind.read(path) for kind, path in found] for name, found in job.artifacts.items()}
    if memory_mb is not None:  # on top of what libraries have mapped already
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        limit = taken + memory_mb * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    def progress(done: float, total: float, note: str = "") -> None:
        heed()
        with held():  # half a message would be none
            pipe.send(("progress", done, total, note))

    make, settings = job.executor
    with one_thread(), make(**settings) as tasks:
        log = logging.getLogger(f"{NAME}.{job.name}")
        arguments: dict[str, Any] = {**arguments_of(job.stage, artifacts, log), **job.lent}
        if job.context is not None:
            parameter, seed, data_root = job.context
            arguments[parameter] = make_context(job.name, seed, data_root, tasks, progress)
        result = job.stage.run(**arguments)
    if isinstance(result, Artifact):
        result.write(job.result)
    else:
        raise PluginError(
            f"R12: it returned a {type(result).__name__}, which is no artifact; nothing was stored"
        )


def _end_with(parent: Any) -> None:
    parent.join()
    os.killpg(os.getpgid(0), signal.SIGKILL)
