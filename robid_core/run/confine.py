"""A stage in a process group of its own: it can be killed, crash or end itself, and the run says so (R10, R11, R09).

Stages of third parties run like this, and any stage under a deadline or a memory limit; never one that moves hardware:
killing what moves a robot is for the drives' own watchdogs. The stage gets the same inputs as in this process, read
from the same files, and leaves its result in a file; what it tells and logs comes through a pipe
(`confined_stage.py` is the other end). Whatever it does to its process - settings of numpy, umask, folder, locale,
threads - ends with it. This is no sandbox: files and network are as open to it as to the run.

A process costs 0.2 s of processor time a stage, and 0.6 s the first, which starts the server that forks them
(`warm_start.py`; `python tests/bench/confinement.py`); `--trust-plugins` saves that.
Effects of third parties are no stages: they are compiled into the simulator, in the run's process.

The stage's process hears SIGTERM as a run hears Ctrl-C. One that has drives is asked to end first, so that they are
stopped and say how that went; then, and everything else at once, it is killed with its whole group.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing.process import BaseProcess
from typing import Any

from robid_core.errors import MotionAborted, PluginError
from robid_core.executors.process import start_resource_tracker
from robid_core.interruption import SIGNALS, heed, held
from robid_core.run.confined_stage import Job, crash_file, last_frame, run_job
from robid_core.run.process_state import umask
from robid_core.run.warm_start import has_died, started

LOG = logging.getLogger("robid.confine")
LOOK_S = 0.05  # how often deadline and interruption are looked at
STOPPING_S = 10.0  # what a process with drives may take to stop them
GONE_S = 5.0  # what the system may take to clear away a killed process
SERVER_GONE = 255  # what multiprocessing gives as exit code where nobody is left who could know it
Hear = Callable[..., None]  # "progress", done, total, note; or "compiling", kernel


def run_confined(job: Job, deadline_s: float | None, memory_mb: int | None, hear: Hear) -> None:
    """Run a stage in another process, which leaves the result at `job.result`; `hear` is told what it tells.

    Raises whatever the stage raises; PluginError where it was killed at its deadline or died. Nothing here waits
    without limit, and KeyboardInterrupt ends the process too.
    """
    confined = _Confined(job, memory_mb)
    try:
        confined.start()
        confined.follow(deadline_s, hear)
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
        self._job, self._memory_mb, self._begun = job, memory_mb, False
        self._here, self._there = multiprocessing.Pipe(duplex=False)
        self._process: BaseProcess | None = None
        self._server: int | None = None

    def start(self) -> None:
        """Start it deaf to signals until it has a process group of its own."""
        with held():
            start_resource_tracker()  # which would let signals through again
            with _blocked_signals():  # in the server too, where this is the first
                arguments = (self._job, self._memory_mb, dict(os.environ), umask(), self._there)
                self._process, self._server = started(run_job, arguments, f"robid {self._job.name}")
            self._there.close()

    def follow(self, deadline_s: float | None, hear: Hear) -> None:
        """Pass on what it tells until it is done; raise its error, or PluginError at the deadline."""
        limit = None if deadline_s is None else time.monotonic() + deadline_s
        while True:
            heed()
            message = self._hear()
            if message is not None:
                if message[0] == "error":
                    raise message[1] from RuntimeError(f"in the stage's own process:\n{message[2]}")
                if message[0] == "done":
                    return
                if message[0] == "log":
                    logging.getLogger(message[1].name).handle(message[1])
                elif message[0] != "begun":
                    hear(*message)
            elif limit is not None and time.monotonic() > limit:
                raise PluginError(
                    f"stage {self._job.name}: R10: not finished after {deadline_s:g} s, and killed with all its "
                    "processes; give it more time with --deadline, or less work"
                )

    def _hear(self, wait_s: float = LOOK_S) -> tuple[Any, ...] | None:
        """Return the next message, None where there is none within `wait_s`; whole, whatever signals come."""
        if not self._here.poll(wait_s):
            assert self._process is not None
            ended = self._process.exitcode not in (None, SERVER_GONE)  # others may hold its end of the line
            if ended and not self._here.poll(0):
                raise self._died()
            return None
        try:
            with held():
                message: tuple[Any, ...] = self._here.recv()
                self._begun = True
                return message
        except EOFError:
            raise self._died() from None

    def _died(self) -> PluginError:
        assert self._process is not None
        self._process.join(GONE_S)
        code = self._process.exitcode
        limit = f" (its limit was {self._memory_mb} MB)" if self._memory_mb else ""
        if code == SERVER_GONE and self._server is not None and has_died(self._server):
            how = "R11: the server that starts processes was killed, and this one ended without a result"
            advice = "run again; where memory runs out the system kills, so give it less work if that repeats"
        elif code is None:
            how = "R09: its process no longer answers: its code put another program in its place"
            advice = "a plugin starts programs beside itself and closes only its own files; tell its author"
        elif code == -signal.SIGKILL:
            how = f"R11: its process was killed{limit}, as the system does where memory runs out"
            advice = "give it less work or a larger --memory, or more processor time where that is limited (ulimit -t)"
        elif code < 0:
            name = signal.Signals(-code).name
            how = f"R09: its code crashed with {name}{last_frame(crash_file(self._job))}{limit}"
            advice = "that is a mistake in compiled code; tell the author of the plugin"
        elif not self._begun:
            how = f"R11: its process ended with exit code {code} before the stage began"
            advice = "raise the limits of the system (ulimit), or tell the author of the plugin, which is imported then"
        else:
            how = f"R09: its code ended its process with exit code {code} before there was a result"
            advice = "a plugin returns or raises; it calls no os._exit and closes only its own files; tell its author"
        return PluginError(f"stage {self._job.name}: {self._job.plugin}: {how}; nothing was stored; {advice}")

    def ask_to_stop(self) -> MotionAborted | None:
        """Let a process with drives stop them, and return what went wrong with that; not for longer than STOPPING_S."""
        if not self._job.has_drives or self._process is None or self._process.pid is None:
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
        if self._process is not None and self._process.pid is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)  # no such group before it has called setsid
            self._process.kill()
            self._process.join(GONE_S)
            if self._process.exitcode is None:
                LOG.warning("process %d of stage %s does not end", self._process.pid, self._job.name)
        self._here.close()
        crash_file(self._job).unlink(missing_ok=True)


@contextlib.contextmanager
def _blocked_signals() -> Iterator[None]:
    """Block signals in this thread; a process that is started now begins with them blocked."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
