"""A dask cluster to compute on: one that stands already, or workers of this machine for the time of a run.

Dask is used as a carrier of bytes. What it logs of its own is silenced; what goes wrong is told as an error of ours.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Iterator
from typing import Any

import dask  # type: ignore[import-not-found, unused-ignore]
import distributed as distributed_package

from robid_core import ConfigurationError, PluginError

distributed: Any = distributed_package  # typed in part only
PATIENCE_S = 20.0  # for a scheduler to answer, and for its first worker
DEATHS = 3  # a task that was there when so many workers died is held to be the cause


@contextlib.contextmanager
def own_settings() -> Iterator[None]:
    """Let large tasks pass without a warning, give a task up after `DEATHS` dead workers.

    Threads are held to one by the task (`task.compute`): a variable for the workers would stand in this
    process too while they start, and numba refuses another number of threads ever after.
    """
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS,
        "distributed.admin.large-graph-warning-threshold": "1 PB",
    }
    with dask.config.set(settings):
        yield


def local_cluster(n_workers: int) -> Any:
    """Start workers on this machine that only this machine can reach; a worker that dies is replaced."""
    return distributed.LocalCluster(
        n_workers=n_workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",  # None would open its port to the network
        worker_dashboard_address="127.0.0.1:0",
        memory_limit=0,  # no writing of results to disk, no pausing: as processes of this machine
        silence_logs=logging.ERROR,
    )


def client_of(cluster: Any) -> Any:
    """Return a client of a local cluster."""
    return distributed.Client(cluster, timeout=PATIENCE_S)


def connect(address: str) -> Any:
    """Return a client of the scheduler at an address, once it has a worker.

    Raises
    ------
    ConfigurationError
        Where it is no address.
    PluginError
        Where no scheduler answers there, or it has no workers.
    """
    advice = "is `dask scheduler` running there, and the port open? leave `address` out for workers of this machine"
    try:
        asyncio.run(asyncio.wait_for(_greet(address), PATIENCE_S))  # the client waits without end
        client = distributed.Client(address, timeout=PATIENCE_S)
    except ValueError as error:
        raise ConfigurationError(
            f"executor: '{address}' is no address of a scheduler ({error}); write it as tcp://HOST:PORT"
        ) from error
    except OSError as error:  # TimeoutError is one
        raise PluginError(
            f"executor: no dask scheduler answers at {address} within {PATIENCE_S:g} s; {advice}"
        ) from error
    try:
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except TimeoutError as error:
        client.close(timeout=5)
        raise PluginError(
            f"executor: the dask scheduler at {address} has no workers after {PATIENCE_S:g} s; start one: "
            f"dask worker {address}"
        ) from error
    return client


async def _greet(address: str) -> None:
    """Ask a scheduler who it is."""
    scheduler = await distributed.core.connect(address)
    try:
        await distributed.core.send_recv(scheduler, op="identity")
    finally:
        scheduler.abort()
