"""Where parallel work is done: in this process, or in a pool of processes of this machine.

An executor is a plugin of the group `robid.executors`: a function of plain settings that returns a context
manager, which gives a `MapTasks`. Tasks are functions of a module's top level over plain values and arrays;
results come in the order of the arguments, and are the same to the bit wherever the work is done: arguments
and results cross the border as copies even where there is no border.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import itertools
import logging
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Annotated, Any

from pydantic import Field

from robid_core.errors import ConfigurationError, PluginError
from robid_core.executors.task import check_task, surviving, task_name
from robid_core.interruption import heed, held

LOG = logging.getLogger("robid.executors")
LOOK_S = 0.5  # how often a wait looks whether the run was told to stop
END_S = 2.0  # a worker has so long to end by itself, and so long to be gone when it is killed
MOST_JOBS = 1024
DEATHS = 3  # so many pools in a row may break before their task is held to be the cause


@dataclass(eq=False)
class _Given:
    """A task that was given to a worker, or has to be."""

    argument: tuple[Any, ...]
    future: concurrent.futures.Future[Any] | None = None

    def result(self) -> Any:
        if self.future is None:
            raise BrokenProcessPool("the pool broke before it took the task")
        while not concurrent.futures.wait([self.future], LOOK_S).done:
            heed()
        return self.future.result()

    @property
    def kept(self) -> bool:
        """Whether it ended before its pool broke."""
        ended = self.future is not None and self.future.done() and not self.future.cancelled()
        return ended and not isinstance(self.future.exception(), BrokenProcessPool)  # type: ignore[union-attr]


@contextlib.contextmanager
def process_executor(jobs: Annotated[int, Field(ge=0, le=MOST_JOBS)] = 0) -> Iterator[ProcessMap]:
    """Runs tasks in `jobs` processes of this machine; 0 takes as many as there are processors, 1 stays in this one.

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
    """Maps in this process, or in a pool of processes where several tasks and several jobs are there."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._pool: concurrent.futures.ProcessPoolExecutor | None = None

    @property
    def threads(self) -> int:
        """How many threads of this process may compute instead, where compiled work needs no process of its own."""
        return self.jobs

    def __call__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call `function` once per tuple; the first exception of the lowest-numbered task is raised."""
        return list(self._results(function, arguments, len(arguments)))

    def stream(self, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Yield results in order while they come; few tasks are in memory at a time."""
        return self._results(function, arguments, 2 * self.jobs + 1)

    def _results(
        self, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]], most: int
    ) -> Iterator[Any]:
        """Yield results in order, `most` tasks under way; what a dead worker had is computed again."""
        check_task(function)
        rest = iter(arguments)
        first = list(itertools.islice(rest, 2))
        rest = itertools.chain(first, rest)
        if self.jobs == 1 or len(first) < 2:
            for argument in rest:
                yield _copy(function(*_copy(argument)))
            return
        waiting: deque[_Given] = deque()
        deaths = 0  # since a result came
        try:
            while True:
                added = [_Given(argument) for argument in itertools.islice(rest, most - len(waiting))]
                waiting.extend(added)
                if not waiting:
                    return
                try:
                    self._give_out(function, added)
                    result = waiting[0].result()
                except BrokenProcessPool as error:
                    deaths += 1
                    self.stop()
                    if deaths > DEATHS:
                        raise PluginError(
                            f"a worker process died while it ran {task_name(function)}, {deaths} times: the system "
                            "killed it (out of memory, or of processor time, ulimit -t?) or its code crashed; run "
                            "again with --jobs 1"
                        ) from error
                    LOG.warning("a worker process died; what it ran of %s begins again", task_name(function))
                    with contextlib.suppress(BrokenProcessPool):  # told when its result is asked for
                        self._give_out(function, [given for given in waiting if not given.kept])
                    continue
                waiting.popleft()
                deaths = 0
                yield result
        finally:
            for given in waiting:
                if given.future is not None:
                    given.future.cancel()

    def _give_out(self, function: Callable[..., Any], tasks: Iterable[_Given]) -> None:
        for given in tasks:
            given.future = None
            pool = self._workers()
            try:
                with held():  # a worker that is started and never told what for ends with a traceback
                    given.future = pool.submit(_call, function, given.argument)
            except OSError as error:
                # A worker died while another one was started: its pipes were closed meanwhile.
                if pool._broken:
                    raise BrokenProcessPool(str(pool._broken)) from error
                raise

    def _workers(self) -> concurrent.futures.ProcessPoolExecutor:
        if self._pool is None:
            start_resource_tracker()
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
        manager: threading.Thread | None = pool._executor_manager_thread  # type: ignore[assignment]
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
        for worker in workers:
            worker.join(END_S)
            worker.kill()  # one that has ended is not touched
            worker.join(END_S)
        if manager is not None:  # an interpreter that ends writes to its pipe, which it closes as it ends
            manager.join(END_S)


def start_resource_tracker() -> None:
    """Start the process of multiprocessing that clears away what killed processes leave; it does so without a word.

    It would call what a run leaves that kills a stage with its pool a leak, on the screen, after the last line.
    """
    sys.warnoptions.append("ignore:resource_tracker")
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.pop()


def _processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _call(function: Callable[..., Any], argument: tuple[Any, ...]) -> Any:
    try:
        return function(*argument)
    except Exception as error:
        raise surviving(error) from error


def _copy(value: Any) -> Any:
    """Return what comes out at the other side of a process border: contiguous copies, nothing shared."""
    return pickle.loads(pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL))


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
