"""What killed processes leave, such as the semaphores of a pool, is cleared away without a word on the screen."""

from __future__ import annotations

import subprocess
import sys
from multiprocessing import resource_tracker, synchronize

import pytest
from faults.fault import fault

from robid_core.executors.process import ProcessMap, start_resource_tracker

LEAVING = """
import os
from multiprocessing import get_context
from robid_core.executors.process import start_resource_tracker

start_resource_tracker()
lock = get_context("spawn").Lock()
print(lock._semlock.name, flush=True)
os._exit(0)
"""


@fault(
    "R11",
    sees="the message of a stage that was killed with its pool of processes, and nothing of leaked semaphores below it",
    mutant=("robid_core/executors/process.py", '"ignore:resource_tracker"', '"default:resource_tracker"'),
)
def test_R11_what_a_killed_process_leaves_is_cleared_away_without_a_word() -> None:
    done = subprocess.run([sys.executable, "-c", LEAVING], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    with pytest.raises(FileNotFoundError):  # its output has ended, and so has who clears away
        synchronize._multiprocessing.SemLock._rebuild(0, 1, 1, done.stdout.strip())  # type: ignore[attr-defined]


def test_a_pool_starts_it_before_its_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    options: list[str] = []
    monkeypatch.setattr(resource_tracker, "ensure_running", lambda: options.extend(sys.warnoptions))
    before = list(sys.warnoptions)
    start_resource_tracker()
    assert options == [*before, "ignore:resource_tracker"]
    assert sys.warnoptions == before
    options.clear()
    workers = ProcessMap(2)
    workers._workers()
    workers.stop()
    assert options[: len(before) + 1] == [*before, "ignore:resource_tracker"]
