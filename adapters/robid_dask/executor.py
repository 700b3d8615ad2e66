"""Tasks of a run on a dask cluster: one that stands already, or workers of this machine.

Only tasks of a stage's `map` go there, motion never does: a task computes the same bytes wherever it runs, so one
whose worker is killed is simply computed again by another worker.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from robid_core import ConfigurationError, PluginError, RobidError, heed
from robid_dask.cluster import client_of, connect, distributed, local_cluster, own_settings
from robid_dask.task import compute, packed, task_name, versions

LOG = logging.getLogger("robid.dask")
AHEAD = 2  # tasks a thread of the cluster has under way and waiting: it is never idle, and memory stays small
LONELY_S = 60.0  # without any worker; a killed one that is replaced is back after seconds


@contextlib.contextmanager
def dask_executor(address: str | None = None, n_workers: int = 2) -> Iterator[DaskMap]:
    """Runs tasks on the workers of a dask cluster.

    `address` is that of a scheduler, as `dask scheduler` prints it; its workers need the versions of robid, numpy,
    scipy, numba and Python of this machine, else tasks are refused. Without it, `n_workers` processes start here with
    the first tasks and listen at 127.0.0.1 only (where other users of this machine could reach them: dask does not
    ask who calls). Used in YAML as::

        executor: {use: dask, with: {address: "tcp://10.0.0.5:8786"}}
    """
    if n_workers < 1:
        raise ConfigurationError(
            f"executor: {n_workers} workers; give one or more, or the address of a scheduler"
        )
    tasks = DaskMap(address, n_workers)
    try:
        if address is not None:
            tasks.start()  # a wrong address is told before any stage runs
        yield tasks
    finally:
        tasks.stop()


class DaskMap:
    """Maps on a cluster; in this process there is only the waiting."""

    def __init__(self, address: str | None, n_workers: int) -> None:
        self.address, self.n_workers = address, n_workers
        self.client: Any = None
        self._cluster: Any = None

    def __call__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call `function` once per tuple; the first exception of the lowest-numbered task is raised."""
        return list(self._results(function, arguments, len(arguments)))

    def stream(self, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Yield results in order while they come; few tasks are under way at a time."""
        return self._results(function, arguments, None)

    def _results(
        self, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]], most: int | None
    ) -> Iterator[Any]:
        """Yield results in order, `most` tasks under way (None: as many as keep the workers busy)."""
        rest = (packed(function, argument) for argument in arguments)
        waiting: deque[Any] = deque()
        tasks = list(itertools.islice(rest, 1))  # what cannot travel is told before a cluster is started
        if not tasks:
            return
        with self._told(function):
            client = self.start()
            lost = _lost_workers(client)
        try:
            while True:
                with self._told(function):
                    room = (self._room(client) if most is None else most) - len(waiting) - len(tasks)
                tasks += itertools.islice(rest, max(room, 0))
                with self._told(function), own_settings():
                    # pure=False: equal arguments are still as many tasks, and no result of another run is taken
                    waiting += client.map(compute, tasks, expected=versions(), pure=False) if tasks else []
                tasks = []
                if not waiting:
                    break
                with self._told(function):
                    outcome, data = self._outcome(client, waiting[0], function)
                waiting.popleft()
                yield self._value(outcome, data, function)
        finally:
            with contextlib.suppress(Exception):
                client.cancel(list(waiting))
        with self._told(function):
            lost = _lost_workers(client) - lost
        if lost:
            LOG.warning("%s: %d workers went away; what they ran was computed again", self._where, lost)

    def start(self) -> Any:
        """Connect, starting workers where there is no address."""
        if self.client is None:
            with own_settings():
                if self.address is not None:
                    self.client = connect(self.address)
                else:
                    self._cluster = local_cluster(self.n_workers)
                    self.client = client_of(self._cluster)
        return self.client

    def stop(self) -> None:
        """Leave the cluster; workers that were started here end."""
        client, self.client = self.client, None
        cluster, self._cluster = self._cluster, None
        for thing in (client, cluster):
            if thing is not None:
                with contextlib.suppress(Exception):  # a scheduler that is gone cannot say goodbye
                    thing.close(timeout=5)

    @staticmethod
    def _room(client: Any) -> int:
        """Return how many tasks keep all workers busy, at present."""
        n_thread: int = sum(client.nthreads().values())
        return max(1, AHEAD * n_thread) + 1

    def _outcome(self, client: Any, future: Any, function: Callable[..., Any]) -> tuple[str, bytes]:
        """Wait for a task, but not for ever where nobody is left to compute it."""
        alone_since: float | None = None
        while True:
            try:
                outcome: tuple[str, bytes] = future.result(timeout=1.0)
                return outcome
            except TimeoutError:  # of the waiting: what a task raises comes as a value
                heed()
                if client.nthreads():
                    alone_since = None
                    continue
            now = time.monotonic()
            alone_since = now if alone_since is None else alone_since
            if now - alone_since > LONELY_S:
                raise PluginError(
                    f"{self._where}: no worker is left to run {task_name(function)}, for {LONELY_S:g} s; start one: "
                    f"dask worker {self.address or 'ADDRESS'}"
                )

    @property
    def _where(self) -> str:
        return f"dask at {self.address}" if self.address else "dask"

    def _value(self, outcome: str, data: bytes, function: Callable[..., Any]) -> Any:
        """Return what a task returned, or raise what it raised."""
        if outcome == "refused":
            raise PluginError(
                f"{self._where}: a worker refused {task_name(function)}: {data.decode()}; install there what is "
                "installed here"
            )
        value = pickle.loads(data)
        if outcome == "raised":
            raise value
        return value

    @contextlib.contextmanager
    def _told(self, function: Callable[..., Any]) -> Iterator[None]:
        """Say what went wrong outside the task."""
        try:
            yield
        except RobidError:
            raise
        except distributed.scheduler.KilledWorker as error:
            raise PluginError(
                f"{self._where}: {error.allowed_failures + 1} workers died while they ran {task_name(function)}: "
                "killed by the system (out of memory?) or its code crashed; run it without this executor to see more"
            ) from error
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
            raise PluginError(
                f"{self._where}: {task_name(function)} could not be run: {reason}; do scheduler and workers live, "
                "with the same robid and dask as here?"
            ) from error


def _lost_workers(client: Any) -> int:
    """Return how many workers went away from the cluster so far, killed or not."""
    events = client.get_events("all")
    return sum(1 for _, event in events if isinstance(event, dict) and event.get("action") == "remove-worker")
