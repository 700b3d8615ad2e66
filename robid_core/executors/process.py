"""Where parallel work is done: in this process, or in a pool of processes of this machine.

An executor is a plugin of the group `robid.executors`: a function of plain settings that returns a context
manager, which gives a `MapTasks`. Tasks are functions of a module's top level over plain values and arrays;
results come in the order of the arguments, and are the same to the bit wherever the work is done: arguments
and results cross the border as copies even where there is no border.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import importlib
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from robid_core.errors import ConfigurationError, PluginError


@contextlib.contextmanager
def process_executor(jobs: int = 0) -> Iterator[ProcessMap]:
    """Give a map over `jobs` processes of this machine; 0 takes as many as there are processors, 1 stays here.

    The pool starts with the first work that can use it, after this process has compiled what it needs: a
    worker then finds compiled kernels on the disk. Used in YAML as::

        executor: {use: process, with: {jobs: 2}}
    """
    if jobs < 0:
        raise ConfigurationError(f"{jobs} jobs: give a number of processes, or 0 for as many as processors")
    tasks = ProcessMap(jobs or _processors())
    try:
        yield tasks
    finally:
        tasks.stop()


class ProcessMap:
    """Maps in this process until there is more than one task and more than one job allowed."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._pool: concurrent.futures.ProcessPoolExecutor | None = None

    def __call__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call `function` once per tuple; the first exception of the lowest-numbered task is raised."""
        _check_task(function)
        if self.jobs == 1 or len(arguments) < 2:
            return [_copy(function(*_copy(argument))) for argument in arguments]
        futures = [self._workers().submit(_call, function, argument) for argument in arguments]
        try:
            return [future.result() for future in futures]
        except BrokenProcessPool as error:
            self.stop()
            raise PluginError(
                f"a worker process died while it ran {_name(function)}: the system killed it (out of memory?) or "
                "its code crashed; run again with --jobs 1"
            ) from error
        except BaseException:
            for future in futures:
                future.cancel()
            raise

    def _workers(self) -> concurrent.futures.ProcessPoolExecutor:
        if self._pool is None:
            self._pool = concurrent.futures.ProcessPoolExecutor(
                self.jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_worker
            )
        return self._pool

    def stop(self) -> None:
        """End the workers now, whatever they are doing."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        workers = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
        for worker in workers:
            worker.join()


def _processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _call(function: Callable[..., Any], argument: tuple[Any, ...]) -> Any:
    return function(*argument)


def _copy(value: Any) -> Any:
    """Return what comes out at the other side of a process border: contiguous copies, nothing shared."""
    return pickle.loads(pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL))


def _name(function: Callable[..., Any]) -> str:
    return f"{getattr(function, '__module__', '?')}.{getattr(function, '__qualname__', repr(function))}"


def _check_task(function: Callable[..., Any]) -> None:
    """Refuse what another process could not find by name, also where no other process is asked."""
    found: Any = None
    with contextlib.suppress(ImportError, AttributeError):
        found = importlib.import_module(function.__module__)
        for part in function.__qualname__.split("."):
            found = getattr(found, part)
    if found is not function:
        raise PluginError(
            f"{_name(function)} cannot be a parallel task: it must be a function at the top of an importable module"
        )


def _begin_worker() -> None:
    """Prepare a worker: one thread, deaf to Ctrl-C (the run ends it), gone when the run is gone."""
    from robid_core.executors.threads import set_variables

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_variables()
    import numpy as np
    from threadpoolctl import threadpool_limits

    del np  # loaded so that the switch below finds its libraries
    threadpool_limits(limits=1)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
