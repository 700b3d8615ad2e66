"""Batches of simulations on a cluster of two workers: the bytes of this process, also when one of them is killed."""

from __future__ import annotations

import importlib
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import PluginError, Robot, simulate_over
from robid_core.pipeline import Pipeline
from robid_core.robot import batch as batch_module, experiments
from robid_core.run import RunOptions, Silence, run_pipeline
from robid_core.stage import map_in_process

distributed = pytest.importorskip("distributed")

from robid_dask import executor as executor_module  # noqa: E402
from robid_dask.executor import DaskMap, dask_executor  # noqa: E402

N_LANE, N_SAMPLE = 90, 4000
PATIENCE_S = 120.0  # a test that hangs fails; nothing is timed by it

PIPELINE = """\
robid: 1
name: study
seed: 11
robot: one_axis
{executor}
stages:
  where: {{use: design.candidates, with: {{count: 12}}}}
  excite: {{use: excitation.multisine, with: {{band_hz: [10, 80], lines: 12, period_s: 1.0, slow_sine_rad_s: 9}}}}
  acquire: {{use: acquisition.simulated, with: {{plant: one_axis_true}}}}
  frf: {{use: frf.log}}
"""


@pytest.fixture(scope="module")
def tasks() -> Iterator[Any]:
    folder = str(Path(__file__).parent)
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(folder)
    patch.setenv("PYTHONPATH", folder, prepend=":")
    yield importlib.import_module("dask_tasks")
    sys.modules.pop("dask_tasks", None)
    patch.undo()


@pytest.fixture(scope="module")
def cluster(tasks: Any) -> Iterator[DaskMap]:
    """Start two workers on this machine."""
    del tasks
    with dask_executor(n_workers=2) as workers:
        yield workers


@pytest.fixture(autouse=True)
def many_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut after eight experiments, so that there are a dozen tasks."""
    monkeypatch.setattr(experiments, "PORTION", 1)


@pytest.fixture(scope="module")
def asked() -> dict[str, Any]:
    generator = np.random.default_rng(3)
    reference = generator.normal(size=(N_LANE, N_SAMPLE, 1)).cumsum(axis=1)
    return {
        "speed_reference": reference - reference.mean(axis=1, keepdims=True),
        "angle": generator.uniform(-0.5, 0.5, (N_LANE, 1)),
        "seed": generator.integers(2**62, size=N_LANE),
    }


def robot_with_effects(folder: Path) -> Robot:
    path = folder / "plant.yaml"
    path.write_text(
        "robid_robot: 1\nbase: one_axis_true\neffects:\n"
        "  stick: {use: friction.lugre, on: axis_1}\n  ripple: {use: drive.torque_ripple, on: axis_1}\n"
        "  hum: {use: sensing.coloured_noise, on: axis_1}\n"
    )
    return Robot.load(str(path))


def within(seconds: float, work: Callable[[], Any]) -> Any:
    """Return what `work` returns; fail where it takes longer, as it would by hanging."""
    found: list[Any] = []
    failed: list[BaseException] = []

    def run() -> None:
        try:
            found.append(work())
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    assert not thread.is_alive(), f"not finished after {seconds} s"
    if failed:
        raise failed[0]
    return found[0]


def data(result: Any) -> list[bytes]:
    return [result.position.tobytes(), result.torque.tobytes(), result.saturated.tobytes()]


def test_a_worker_killed_in_the_middle_of_a_batch_costs_time_and_no_byte(
    cluster: DaskMap, asked: dict[str, Any], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    robot = robot_with_effects(tmp_path)
    expected = simulate_over(map_in_process, robot, **asked)
    workers = dict(cluster.start().run(os.getpid))
    assert len(workers) == 2
    steps: list[tuple[float, float]] = []
    killed: list[int] = []

    def progress(done: float, total: float, note: str) -> None:
        steps.append((done, total))
        if done and not killed:
            # Stopped while it has tasks it can no longer finish, then killed: in the middle by construction.
            busy = {w: keys for w, keys in cluster.client.processing().items() if keys}
            victim = workers[max(workers, key=lambda worker: len(busy.get(worker, ())))]
            os.kill(victim, signal.SIGSTOP)
            time.sleep(0.1)
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    with caplog.at_level(logging.WARNING, "robid"):
        got = within(PATIENCE_S, lambda: simulate_over(cluster, robot, **asked, progress=progress))
    assert killed
    assert data(got) == data(expected)
    assert steps == [(min(done, N_LANE), N_LANE) for done in range(0, N_LANE + 8, 8)]
    assert "1 workers went away; what they ran was computed again" in caplog.text
    assert set(cluster.start().run(os.getpid).values()).isdisjoint(killed)


def test_a_worker_computes_with_one_thread(cluster: DaskMap, tasks: Any) -> None:
    for counts, numba_threads in cluster(tasks.threads, [(0,), (1,)]):
        assert counts
        assert set(counts) == {1}
        assert numba_threads == 1


def test_a_worker_with_other_code_refuses_and_is_told(
    cluster: DaskMap, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = batch_module.unit
    monkeypatch.setattr(
        batch_module, "unit", lambda *place: tuple((*code[:4], "0" * 64) for code in real(*place))
    )
    with pytest.raises(
        PluginError,
        match=r"'simulate\.experiments' was to be computed on .* it has other sources .* install the same",
    ):
        within(PATIENCE_S, lambda: simulate_over(cluster, Robot.load("one_axis"), **asked))


def test_a_cluster_whose_last_worker_is_gone_is_told(
    tasks: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executor_module, "LONELY_S", 1.0)
    mark = tmp_path / "begun"
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as standing,
        dask_executor(address=standing.scheduler_address) as cluster,
    ):

        def end_it() -> None:
            while not mark.exists():
                time.sleep(0.01)
            standing.scale(0)

        end = threading.Thread(target=end_it)
        end.start()
        with pytest.raises(
            PluginError, match=r"no worker is left to run dask_tasks\.wait, for 1 s; start one"
        ):
            within(PATIENCE_S, lambda: cluster(tasks.wait, [(str(mark),)]))
        end.join()


def test_few_results_are_under_way_at_a_time(cluster: DaskMap, tasks: Any) -> None:
    asked_for: list[int] = []

    def arguments() -> Iterator[tuple[int]]:
        for number in range(60):
            asked_for.append(number)
            yield (number,)

    results = cluster.stream(tasks.process_or_not, arguments())
    for index, result in enumerate(results):
        assert result == index
        assert len(asked_for) <= index + 1 + 2 * 2 + 1, "two a thread, and one"
    assert len(asked_for) == 60


def test_who_has_seen_enough_leaves_the_cluster_idle(cluster: DaskMap, tasks: Any) -> None:
    results = cluster.stream(tasks.process_or_not, ((number,) for number in range(60)))
    assert next(results) == 0
    results.close()
    assert within(PATIENCE_S, lambda: cluster(tasks.process_or_not, [(7,)])) == [7]


def test_a_mistake_in_the_arguments_is_told_as_it_is(cluster: DaskMap, tasks: Any) -> None:
    def arguments() -> Iterator[tuple[int]]:
        yield (0,)
        raise ZeroDivisionError("the caller's mistake")

    results = cluster.stream(tasks.process_or_not, arguments())
    with pytest.raises(ZeroDivisionError, match="the caller's mistake"):
        list(results)


class Heard(Silence):
    """Hears what a run tells of one stage."""

    def __init__(self) -> None:
        self.told: list[tuple[float, float, str]] = []

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        """Keep what the acquisition tells."""
        if stage == "acquire":
            self.told.append((done, total, note))


def test_a_run_on_a_cluster_makes_the_artifacts_of_a_run_here(tmp_path: Path) -> None:
    digests, heard = {}, {}
    for name, executor in {
        "here": "executor: {use: process, with: {jobs: 1}}",
        "cluster": "executor: {use: dask, with: {n_workers: 2}}",
    }.items():
        folder = tmp_path / name
        folder.mkdir()
        file = folder / "pipeline.yaml"
        file.write_text(PIPELINE.format(executor=executor))
        listener = heard[name] = Heard()

        def run(file: Path = file, listener: Heard = listener) -> Any:
            return run_pipeline(Pipeline.load(file), RunOptions(), listener)

        result = within(PATIENCE_S, run)
        assert set(result.outcomes.values()) == {"made"}
        digests[name] = {stage: record.sha256 for stage, record in result.manifest.stages.items()}
    assert digests["cluster"] == digests["here"]
    n_experiment = heard["here"].told[-1][1]
    assert n_experiment > 8
    for listener in heard.values():  # from how many are done the screen tells the time left
        assert [done for done, _, _ in listener.told if done] == [
            *range(8, int(n_experiment), 8),
            n_experiment,
        ]
        assert {total for _, total, _ in listener.told} == {n_experiment}
    first = {
        name: next(note for done, _, note in told.told if done == 0 and "simul" in note)
        for name, told in heard.items()
    }
    assert "on the workers" in first["cluster"]
    assert "on the workers" not in first["here"]
