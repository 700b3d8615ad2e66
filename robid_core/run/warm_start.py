"""Processes of stages that need not import robid anew: a server imports it once and forks itself for each.

The server is multiprocessing's: it runs no code of third parties, ends with the run, and gives each stage the state of
a process that has just begun. It starts with the signals of a run blocked, so Ctrl-C at a terminal reaches the run and
its stages, and not the server. Where it cannot start (no folder for its socket, a limit of the system), was killed
while it started a process, or does not answer, that process is a Python of its own.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from typing import Any

LOG = logging.getLogger("robid.confine")
_IMPORTED = ["robid_core.run.preloaded"]
_OWNER = os.getpid()
LONGEST_START_S = 60.0  # a second on an idle computer
_LAST_BREATH_S = 0.5  # in which the system says that a process is dead whose files it has closed


def started(
    target: Callable[..., Any], arguments: tuple[Any, ...], name: str
) -> tuple[BaseProcess, int | None]:
    """Start a process; return it, and the process id of the server that it was forked from, where it was.

    A process that was forked from one that has a server cannot use that, and starts Python anew for each stage.
    """
    if os.getpid() == _OWNER:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(_IMPORTED)
        process: BaseProcess = context.Process(target=target, args=arguments, name=name)
        try:
            with _limit_of_waiting():
                process.start()
        except (OSError, EOFError, RuntimeError) as error:  # the last: no thread can be started
            LOG.warning("no server can start the process of a stage (%s): it starts Python anew", error)
        else:
            return process, _server()
    process = multiprocessing.get_context("spawn").Process(target=target, args=arguments, name=name)
    process.start()
    return process, None


@contextlib.contextmanager
def _limit_of_waiting() -> Iterator[None]:
    """Kill a server that does not answer: it was stopped, or hangs while it imports (OpenBLAS without memory does)."""
    limit = threading.Timer(LONGEST_START_S, _kill)
    limit.daemon = True
    limit.start()
    try:
        yield
    finally:
        limit.cancel()


def _kill() -> None:
    if (server := _server()) is not None:
        os.kill(server, signal.SIGKILL)


def _server() -> int | None:
    """Return the server's process id, which nothing public says while it starts; None where Python keeps it no more.

    Without it a server that does not answer is waited for, and one that was killed is not told from a stage that was.
    """
    keeper = getattr(forkserver, "_forkserver", None)
    number: int | None = getattr(keeper, "_forkserver_pid", None)
    return number


def has_died(server: int) -> bool:
    """Tell whether a server was killed; multiprocessing gives its processes exit code 255 then, however they ended."""
    limit = time.monotonic() + _LAST_BREATH_S
    with contextlib.suppress(ChildProcessError):  # dead, and replaced already
        while os.waitid(os.P_PID, server, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            if time.monotonic() > limit:
                return False
            time.sleep(0.01)
    return True
