"""Tasks of a run on a dask cluster: one that stands already, or workers of this machine.

Only tasks of a stage's `map` go there, motion never does: a task computes the same bytes wherever it runs, so one
whose worker is killed is simply computed again by another worker.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import pickle
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import dask  # type: ignore[import-not-found, unused-ignore]
import distributed as distributed_package

from robid_core import ConfigurationError, PluginError
from robid_dask.task import compute, packed, task_name, versions

distributed: Any = distributed_package  # typed in part only
PATIENCE_S = 20.0  # for a scheduler to answer, and for its first worker
DEATHS = 3  # a task that was there when so many workers died is held to be the cause


@contextlib.contextmanager
def dask_executor(address: str | None = None, n_workers: int = 2) -> Iterator[DaskMap]:
    """Give a map over the workers of a dask cluster.

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
        tasks = [packed(function, argument) for argument in arguments]
        if not tasks:
            return []
        client, futures = self.start(), []
        try:
            with _own_settings():
                # pure=False: equal arguments are still as many tasks, and no result of another run is taken
                futures = client.map(compute, tasks, expected=versions(), pure=False)
            outcomes = (future.result() for future in futures)
            return [self._value(outcome, data, function) for outcome, data in outcomes]
        except BaseException as error:
            with contextlib.suppress(Exception):
                client.cancel(futures)
            if isinstance(error, _FromTask):
                raise error.value from None
            if isinstance(error, PluginError) or not isinstance(error, Exception):
                raise
            raise self._failed(error, function) from error

    def start(self) -> Any:
        """Connect, starting workers where there is no address."""
        if self.client is None:
            with _own_settings():
                self.client = self._connected() if self.address else self._local()
        return self.client

    def stop(self) -> None:
        """Leave the cluster; workers that were started here end."""
        client, self.client = self.client, None
        cluster, self._cluster = self._cluster, None
        for thing in (client, cluster):
            if thing is not None:
                with contextlib.suppress(Exception):  # a scheduler that is gone cannot say goodbye
                    thing.close(timeout=5)

    def _local(self) -> Any:
        self._cluster = distributed.LocalCluster(
            n_workers=self.n_workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # None would open its port to the network
            worker_dashboard_address="127.0.0.1:0",
            memory_limit=0,  # no writing of results to disk, no pausing: as processes of this machine
            silence_logs=logging.ERROR,
        )
        return distributed.Client(self._cluster, timeout=PATIENCE_S)

    def _connected(self) -> Any:
        advice = "is `dask scheduler` running there, and the port open? leave `address` out for workers of this machine"
        try:
            asyncio.run(asyncio.wait_for(_greet(self.address), PATIENCE_S))  # the client waits without end
            client = distributed.Client(self.address, timeout=PATIENCE_S)
        except ValueError as error:
            raise ConfigurationError(
                f"executor: '{self.address}' is no address of a scheduler ({error}); write it as tcp://HOST:PORT"
            ) from error
        except OSError as error:  # TimeoutError is one
            raise PluginError(
                f"executor: no dask scheduler answers at {self.address} within {PATIENCE_S:g} s; {advice}"
            ) from error
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as error:
            client.close(timeout=5)
            raise PluginError(
                f"executor: the dask scheduler at {self.address} has no workers after {PATIENCE_S:g} s; start one: "
                f"dask worker {self.address}"
            ) from error
        return client

    @property
    def _where(self) -> str:
        return f"dask at {self.address}" if self.address else "dask"

    def _value(self, outcome: str, data: bytes, function: Callable[..., Any]) -> Any:
        if outcome == "refused":
            raise PluginError(
                f"{self._where}: a worker refused {task_name(function)}: {data.decode()}; install there what is "
                "installed here"
            )
        value = pickle.loads(data)
        if outcome == "raised":
            raise _FromTask(value)
        return value

    def _failed(self, error: Exception, function: Callable[..., Any]) -> PluginError:
        """Say what went wrong outside the task."""
        if isinstance(error, distributed.scheduler.KilledWorker):
            return PluginError(
                f"{self._where}: {error.allowed_failures + 1} workers died while they ran {task_name(function)}: "
                "killed by the system (out of memory?) or its code crashed; run it without this executor to see more"
            )
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        return PluginError(
            f"{self._where}: {task_name(function)} could not be run: {reason}; do scheduler and workers live, with "
            "the same robid and dask as here?"
        )


class _FromTask(Exception):
    """What a task raised, told from what dask raises."""

    def __init__(self, value: Exception) -> None:
        super().__init__(str(value))
        self.value = value


async def _greet(address: str | None) -> None:
    """Ask a scheduler who it is."""
    scheduler = await distributed.core.connect(address)
    try:
        await distributed.core.send_recv(scheduler, op="identity")
    finally:
        scheduler.abort()


@contextlib.contextmanager
def _own_settings() -> Iterator[None]:
    """Use dask as a carrier of bytes: large tasks are meant, and a task is given up after `DEATHS` dead workers."""
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS,
        "distributed.admin.large-graph-warning-threshold": "1 PB",
    }
    with dask.config.set(settings):
        yield
