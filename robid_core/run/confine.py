"""A stage under a deadline or a memory limit: in a process group of its own that can be killed (R10, R11).

Only where it is asked for, and never for hardware: killing what moves a robot is for the drives' own
watchdogs. The stage gets the same inputs as in this process, read from the same files, and leaves its result
in a file; what it tells comes through a pipe.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
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

from robid_core.artifacts import Artifact
from robid_core.errors import PluginError
from robid_core.stage import Stage

GRACE_S = 0.05  # how often the deadline is looked at


@dataclass(frozen=True)
class Job:
    """A stage and what it takes, so that another process can run it."""

    name: str
    stage: Stage
    artifacts: Mapping[str, tuple[type[Artifact], Path]]  # by parameter
    lent: Mapping[str, Any]  # by parameter; the Context is made over there
    context: tuple[str, int, Path] | None  # parameter, seed of the pipeline, data root
    executor: tuple[Callable[..., Any], Mapping[str, Any]]
    result: Path


def run_confined(
    job: Job,
    deadline_s: float | None,
    memory_mb: int | None,
    progress: Callable[[float, float, str], None],
) -> None:
    """Run a stage in another process, which leaves the result at `job.result`.

    Raises whatever the stage raises; PluginError where it was killed at its deadline or died.
    """
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_child, args=(job, memory_mb, there), name=f"robid {job.name}")
    process.start()
    there.close()
    limit = None if deadline_s is None else time.monotonic() + deadline_s
    try:
        while True:
            if here.poll(GRACE_S):
                try:
                    message = here.recv()
                except EOFError:
                    raise _died(job, process.exitcode, memory_mb) from None
                if message[0] == "progress":
                    progress(*message[1:])
                elif message[0] == "done":
                    return
                else:
                    raise message[1] from RuntimeError(f"in the stage's own process:\n{message[2]}")
            elif limit is not None and time.monotonic() > limit:
                raise PluginError(
                    f"stage {job.name}: R10: not finished after {deadline_s:g} s, and killed with all its processes; "
                    "give it more time with --deadline, or less work"
                )
    finally:
        _end(process)
        here.close()


def _died(job: Job, code: int | None, memory_mb: int | None) -> PluginError:
    limit = f" (its limit was {memory_mb} MB)" if memory_mb else ""
    return PluginError(
        f"stage {job.name}: R11: its process died{f' with code {code}' if code is not None else ''}{limit}: killed by "
        "the system for memory, or its code crashed; give it less work or a larger --memory"
    )


def _end(process: Any) -> None:
    """Kill the stage's process group, children and all; a finished one is only collected."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.join()


def _child(job: Job, memory_mb: int | None, pipe: Connection) -> None:
    os.setsid()  # a process group of its own, which ends as a whole
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    try:
        _work(job, memory_mb, pipe)
    except BaseException as error:
        text = traceback.format_exc()
        error.robid_frames = list(traceback.extract_tb(error.__traceback__))  # type: ignore[attr-defined]
        try:
            pipe.send(("error", error, text))
        except Exception:  # it cannot be sent as it is
            pipe.send(("error", PluginError(f"{type(error).__name__}: {error}"), text))
    else:
        pipe.send(("done",))


def _work(job: Job, memory_mb: int | None, pipe: Connection) -> None:
    from robid_core.executors import one_thread
    from robid_core.run.calling import make_context

    artifacts = {name: kind.read(path) for name, (kind, path) in job.artifacts.items()}
    if memory_mb is not None:  # on top of what libraries have mapped already
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        limit = taken + memory_mb * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    def progress(done: float, total: float, note: str = "") -> None:
        pipe.send(("progress", done, total, note))

    make, settings = job.executor
    with one_thread(), make(**settings) as tasks:
        arguments = {**artifacts, **job.lent}
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
