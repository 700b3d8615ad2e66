"""Tasks on a dask cluster: the bytes of this process, workers killed, schedulers that are not there."""

from __future__ import annotations

import importlib
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, PluginError
from robid_core.executors import process_executor
from robid_core.registry import EXECUTORS, registry

distributed = pytest.importorskip("distributed")

from robid_dask import cluster as cluster_module, executor as executor_module, task as task_module  # noqa: E402
from robid_dask.executor import DaskMap, dask_executor  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def tasks() -> Iterator[Any]:
    """Import the tasks by a name that worker processes, which inherit the path, can use too."""
    folder = str(Path(__file__).parent)
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(folder)
    patch.setenv("PYTHONPATH", folder, prepend=":")
    yield importlib.import_module("dask_tasks")
    sys.modules.pop("dask_tasks", None)
    patch.undo()


@pytest.fixture(scope="module")
def local(tasks: Any) -> Iterator[DaskMap]:
    """Start two workers on this machine."""
    del tasks
    with dask_executor(n_workers=2) as cluster:
        yield cluster


def test_results_have_the_bytes_and_the_order_of_this_process(local: DaskMap, tasks: Any) -> None:
    rng = np.random.default_rng(5)
    # strided and transposed arrays cross as they cross to a process of this machine
    arguments = [(seed, rng.normal(size=(40, 60))[::2].T) for seed in range(6)]
    with process_executor(jobs=1) as here:
        expected = here(tasks.solve, arguments)
    got = local(tasks.solve, arguments)
    assert [result["seed"] for result in got] == list(range(6))
    for ours, theirs in zip(got, expected, strict=True):
        for name in ("values", "vectors", "complex"):
            assert ours[name].dtype == theirs[name].dtype
            assert ours[name].flags.c_contiguous == theirs[name].flags.c_contiguous
            assert ours[name].tobytes() == theirs[name].tobytes()


def test_work_is_shared_by_other_processes(local: DaskMap, tasks: Any) -> None:
    numbers = set(local(tasks.process_number, [(i,) for i in range(8)]))
    assert len(numbers) == 2


def test_only_this_machine_can_reach_scheduler_and_workers(local: DaskMap) -> None:
    psutil = pytest.importorskip("psutil")
    local.start()
    here = psutil.Process()
    found = [c for p in (here, *here.children(recursive=True)) for c in p.net_connections("tcp")]
    listening = [connection.laddr for connection in found if connection.status == psutil.CONN_LISTEN]
    assert len(listening) >= 3, "a scheduler and two workers"
    assert {address.ip for address in listening} == {"127.0.0.1"}


def test_a_task_whose_worker_is_killed_is_computed_again(local: DaskMap, tasks: Any, tmp_path: Path) -> None:
    got = local(tasks.die_once, [(i, str(tmp_path)) for i in range(8)])
    assert (tmp_path / "died").exists()
    assert got == [i**2 for i in range(8)]


def test_a_task_that_kills_every_worker_is_given_up(tasks: Any) -> None:
    with (
        dask_executor(n_workers=1) as cluster,
        pytest.raises(PluginError, match=r"4 workers died while they ran dask_tasks.die"),
    ):
        cluster(tasks.die, [(0,)])


def test_the_first_exception_is_raised_as_the_task_raised_it(local: DaskMap, tasks: Any) -> None:
    with pytest.raises(ValueError, match="task 1 cannot be done"):
        local(tasks.refuse, [(i,) for i in range(4)])
    assert local(tasks.refuse, [(0,)]) == [0], "the executor still works after a task raised"
    with pytest.raises(PluginError, match="Unpackable: too much"):
        local(tasks.raise_unpackable, [(0,)])


def test_no_tasks_need_no_workers(tasks: Any) -> None:
    with dask_executor() as cluster:
        assert cluster(tasks.refuse, []) == []
        assert cluster.client is None


def test_a_function_without_a_name_elsewhere_is_refused(local: DaskMap) -> None:
    with pytest.raises(PluginError, match="must be a function at the top of an importable module"):
        local(lambda x: x, [(1,)])


def test_a_standing_cluster_is_used_and_left_standing(local: DaskMap, tasks: Any) -> None:
    address = local.start().scheduler_info()["address"]
    with dask_executor(address=address) as cluster:
        assert cluster(tasks.refuse, [(0,)]) == [0]
    assert local(tasks.refuse, [(0,)]) == [0]


def test_workers_with_other_versions_are_refused(
    local: DaskMap, tasks: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executor_module, "versions", lambda: {**task_module.versions(), "numpy": "1.0.0"})
    with pytest.raises(
        PluginError, match=r"worker refused dask_tasks.refuse: it has numpy .* and not 1\.0\.0"
    ):
        local(tasks.refuse, [(0,)])


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(PluginError) as told, dask_executor(address=address):
        pass
    assert address in str(told.value)
    assert "is `dask scheduler` running there" in str(told.value)


def test_a_host_that_says_nothing_is_told_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(PluginError, match="no dask scheduler answers"), dask_executor(address=address):
            pass


def test_a_scheduler_without_workers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as empty:
        monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.5)
        with (
            pytest.raises(PluginError, match=r"has no workers .* start one: dask worker tcp://"),
            dask_executor(address=empty.scheduler_address),
        ):
            pass


def test_an_address_that_is_none_is_a_mistake_of_the_pipeline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.5)
    with (
        pytest.raises(ConfigurationError, match="no address of a scheduler"),
        dask_executor(address="foo://bar"),
    ):
        pass


def test_a_cluster_that_ends_between_tasks_is_told(tasks: Any) -> None:
    with dask_executor(n_workers=1) as cluster:
        assert cluster(tasks.refuse, [(0,)]) == [0]
        cluster._cluster.close()
        with pytest.raises(PluginError, match="dask: dask_tasks.refuse could not be run"):
            cluster(tasks.refuse, [(0,)])


def test_a_scheduler_that_ends_during_a_task_is_told(
    tasks: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 2.0)
    standing = DaskMap(None, 1)
    standing.start()
    mark = tmp_path / "begun"

    def end_it() -> None:
        while not mark.exists():
            time.sleep(0.01)
        standing.stop()

    with dask_executor(address=standing._cluster.scheduler_address) as cluster:
        end = threading.Thread(target=end_it)
        end.start()
        with pytest.raises(PluginError, match=r"dask at tcp://.*: dask_tasks.wait could not be run"):
            cluster(tasks.wait, [(str(mark),)])
        end.join()


def test_the_executor_is_registered_with_its_settings() -> None:
    from robid_core.pipeline.checking import settings_model

    plugin = registry().find(EXECUTORS, "dask")
    model = settings_model(plugin.load())
    assert model.model_validate_json("{}").model_dump() == {"address": None, "n_workers": 2}
    with pytest.raises(ConfigurationError, match="0 workers; give one or more"), dask_executor(n_workers=0):
        pass


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "robid_dask"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(PluginError, match=r'run: pip install "robid\[dask\]"$'):
        registry().load(EXECUTORS, "dask")
