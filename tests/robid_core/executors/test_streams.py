"""Results come in order while they are computed, few tasks are in memory, and dead workers cost time only."""

from __future__ import annotations

import importlib
import logging
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core.errors import PluginError
from robid_core.executors import process_executor
from robid_core.executors.process import ProcessMap
from robid_core.executors.stream import PORTION, stream, stream_threads
from robid_core.stage import map_in_process


@pytest.fixture(scope="module")
def tasks() -> Iterator[Any]:
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(Path(__file__).parent))
    yield importlib.import_module("stream_tasks")
    sys.modules.pop("stream_tasks", None)
    patch.undo()


@pytest.fixture(scope="module")
def two(tasks: Any) -> Iterator[ProcessMap]:
    del tasks
    with process_executor(jobs=2) as workers:
        yield workers


class Asked:
    """Arguments that note how many of them were asked for."""

    def __init__(self, n: int) -> None:
        self.n, self.asked = n, 0

    def __iter__(self) -> Iterator[tuple[int]]:
        for number in range(self.n):
            self.asked += 1
            yield (number,)


def test_arguments_are_asked_for_when_there_is_room(two: ProcessMap, tasks: Any) -> None:
    for ahead, results in (
        (1, lambda asked: stream(map_in_process, tasks.square, asked)),
        (5, lambda asked: stream(two, tasks.square, asked)),  # 2 a process and 1
        (3, lambda asked: stream_threads(2, tasks.square, asked)),  # 1 a thread and 1
        (1, lambda asked: stream_threads(1, tasks.square, asked)),
    ):
        asked = Asked(20)
        for index, result in enumerate(results(asked)):
            assert result == index**2
            assert index < asked.asked <= index + ahead
        assert asked.asked == 20


def test_an_executor_that_can_only_be_called_gets_a_few_tasks_at_a_time(tasks: Any) -> None:
    class Plain:
        sizes: list[int] = []

        def __call__(self, function: Any, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
            self.sizes.append(len(arguments))
            return [function(*argument) for argument in arguments]

    assert list(stream(Plain(), tasks.square, Asked(40))) == [n**2 for n in range(40)]
    assert Plain.sizes == [PORTION, PORTION, 40 - 2 * PORTION]


def test_streamed_bytes_are_those_of_one_process(two: ProcessMap, tasks: Any) -> None:
    values = np.random.default_rng(0).normal(size=(1001, 40))

    def arguments() -> Iterator[tuple[Any, ...]]:
        return ((values[::step, ::-2], 1.0 + step) for step in (1, 2, 3, 5, 7, 11))

    with process_executor(jobs=1) as here:
        expected = [result.tobytes() for result in stream(here, tasks.total, arguments())]
    assert [result.tobytes() for result in stream(two, tasks.total, arguments())] == expected


def test_who_has_seen_enough_leaves_the_executor_ready(two: ProcessMap, tasks: Any) -> None:
    asked = Asked(1000)
    results = stream(two, tasks.square, asked)
    assert next(results) == 0
    results.close()
    assert asked.asked < 10
    assert two(tasks.square, [(1,), (2,)]) == [1, 4]


def test_tasks_of_a_killed_process_are_computed_again_and_it_is_told(
    two: ProcessMap, tasks: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    arguments = [(number, str(tmp_path), "3") for number in range(12)]
    with caplog.at_level(logging.WARNING, "robid"):
        assert list(stream(two, tasks.die_once, arguments)) == [number**2 for number in range(12)]
    assert (tmp_path / "died").exists()
    assert "a worker process died; what it ran of stream_tasks.die_once begins again" in caplog.text
    (tmp_path / "died").unlink()
    assert two(tasks.die_once, arguments) == [number**2 for number in range(12)]


def test_a_task_that_kills_every_process_is_given_up_and_what_came_before_is_kept(
    two: ProcessMap, tasks: Any
) -> None:
    results = stream(two, tasks.die_at, [(number, 2) for number in range(9)])
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(PluginError, match=r"process died while it ran stream_tasks\.die_at, 4 times"):
        next(results)
    assert two(tasks.square, [(1,), (2,)]) == [1, 4], "a new pool"


def test_a_worker_that_dies_while_another_one_is_started_is_a_dead_worker(
    tasks: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The pool has closed its pipes by then, and starting fails with an OSError; any other one is passed on."""
    spawn, times = ProcessPoolExecutor._spawn_process, list[str]()

    def fails_first(pool: Any) -> None:
        if not times:
            times.append("once")
            pool._broken = "a child process terminated abruptly"
            raise OSError("handle is closed")
        spawn(pool)

    monkeypatch.setattr(ProcessPoolExecutor, "_spawn_process", fails_first)
    with process_executor(jobs=2) as workers, caplog.at_level(logging.WARNING, "robid"):
        assert workers(tasks.square, [(1,), (2,), (3,)]) == [1, 4, 9]
    assert "a worker process died" in caplog.text

    def never(pool: Any) -> None:
        raise OSError("too many open files")

    monkeypatch.setattr(ProcessPoolExecutor, "_spawn_process", never)
    with process_executor(jobs=2) as workers, pytest.raises(OSError, match="too many open files"):
        workers(tasks.square, [(1,), (2,), (3,)])


def test_an_exception_that_cannot_travel_is_told_and_kills_nobody(two: ProcessMap, tasks: Any) -> None:
    with pytest.raises(PluginError, match="Unpackable: too much"):
        two(tasks.raise_unpackable, [(0,), (1,), (2,)])


def test_an_exception_in_a_thread_is_raised_in_its_turn(tasks: Any) -> None:
    results = stream_threads(2, tasks.raise_unpackable, [(0,), (1,), (2,)])
    assert next(results) == 0
    with pytest.raises(tasks.Unpackable):
        next(results)
