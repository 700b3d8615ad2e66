"""A stage that has drives computes in the run's own process, whatever the executor is (R17: motion never twice)."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from robid_core.run import calling, runner

ASK = 'called("acquire")\n        context.map(where, [(1,), (2,)])\n'
WHERE = "\n\ndef where(number):\n    called(f'process {os.getpid()}')\n    return number\n\n\nclass Where("


class Elsewhere:
    """An executor that says what it is asked for."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def __call__(self, function: Any, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        self.asked.append(function.__name__)
        return [function(*argument) for argument in arguments]


@pytest.fixture
def elsewhere(world: Any, monkeypatch: pytest.MonkeyPatch) -> Elsewhere:
    world.edit('called("acquire")\n', ASK)
    world.edit("\n\nclass Where(", WHERE)
    executor = Elsewhere()

    @contextlib.contextmanager
    def chosen(*_: Any) -> Iterator[Elsewhere]:
        yield executor

    monkeypatch.setattr(runner, "executor", chosen)
    return executor


@pytest.mark.parametrize("drives", ["strange", "strange_hardware"])
def test_only_stages_without_drives_use_the_executor(world: Any, elsewhere: Elsewhere, drives: str) -> None:
    world.say("{use: strange}", f"{{use: {drives}}}")
    world.run(last="frf", at_the_robot=True)
    assert elsewhere.asked == ["square"], "the frf stage's work, not the acquisition's"
    assert [name for name in world.calls.read_text().splitlines() if name.startswith("process")] == [
        f"process {os.getpid()}"
    ] * 2


def test_under_a_deadline_it_stays_in_the_stages_own_process(
    world: Any, elsewhere: Elsewhere, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs: list[Any] = []
    real = calling.run_confined

    def confined(job: Any, *rest: Any) -> None:
        jobs.append(job)
        real(job, *rest)

    monkeypatch.setattr(calling, "run_confined", confined)
    world.run(last="acquire", deadline_s=60.0, jobs=2)
    (settings,) = [dict(job.executor[1]) for job in jobs if job.name == "acquire"]
    assert settings == {"jobs": 1}
    processes = {name for name in world.calls.read_text().splitlines() if name.startswith("process")}
    assert len(processes) == 1
