"""kill -9 at any moment: the next run finishes what is left, and the bytes are those of an undisturbed run (R01)."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from robid_core.store import Files

ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]


class DyingFiles(Files):
    """Kills its own process at the n-th operation, before or after it is done."""

    def __init__(self, last: int, before: bool) -> None:
        self.left, self.before = last, before

    def __getattribute__(self, name: str) -> Any:
        found = super().__getattribute__(name)
        if name.startswith("_") or name in ("left", "before"):
            return found

        def operation(*arguments: Any) -> Any:
            self.left -= 1
            if self.left == 0 and self.before:
                os.kill(os.getpid(), signal.SIGKILL)
            try:
                return found(*arguments)
            finally:
                if self.left == 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        return operation


def run_and_die(world: Any, last: int, before: bool) -> bool:
    """Run in a forked process that dies at its n-th file operation; tell whether it came to that."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            world.run(files=DyingFiles(last, before))
            code = 0
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    if os.WIFEXITED(status):
        assert os.WEXITSTATUS(status) == 0
        return False
    assert os.WTERMSIG(status) == signal.SIGKILL
    return True


def undisturbed(world: Any) -> dict[str, str]:
    world.run()
    hashes: dict[str, str] = world.hashes()
    subprocess.run(["rm", "-rf", str(world.folder)], check=True)
    world.ran()
    return hashes


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_killed_at_every_other_file_operation_a_run_resumes_with_the_same_bytes(world: Any) -> None:
    wanted = undisturbed(world)
    generator = random.Random(5)
    finished: set[str] = set()
    while run_and_die(world, generator.randint(2, 90), generator.random() < 0.5):
        calls = world.ran()
        assert not set(calls) & finished, "a finished stage ran again"
        index = world.folder / "store" / "index"
        entries = [world.store.lookup(path.stem) for path in index.iterdir()] if index.is_dir() else []
        assert {found.state.value for found in entries} <= {"present"}
        finished = {found.entry.stage for found in entries if found.entry is not None}
        assert len(finished) <= len(ORDER)
    assert world.hashes() == wanted
    assert world.run().idle
    assert list((world.folder / "store" / "temporary").iterdir()) == []


@pytest.mark.full
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_killed_at_each_file_operation_a_run_resumes_with_the_same_bytes(world: Any) -> None:
    wanted = undisturbed(world)
    for before in (True, False):
        last = 1
        while run_and_die(world, last, before):
            world.run()
            assert world.hashes() == wanted
            subprocess.run(["rm", "-rf", str(world.folder)], check=True)
            last += 1
        assert last > 100


@pytest.mark.full
def test_killed_at_random_moments_a_run_resumes_with_the_same_bytes(world: Any) -> None:
    world.say("{use: strange.measure,", "{use: strange.measure, with: {seconds: 0.4},")
    world.say("{use: strange.estimate}", "{use: strange.estimate, with: {hold: 0.4}}")
    wanted = undisturbed(world)
    generator = random.Random(11)
    log: Path = world.folder / "log.txt"
    for _ in range(4):  # tests/system/kills.py kills by the dozen
        lines = log.read_text().count("\n") if log.exists() else 0
        process = subprocess.Popen(
            world.command(), env=world.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 60
        while not (log.exists() and log.read_text().count("\n") > lines) and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.005)
        time.sleep(generator.uniform(0, 0.7))
        process.kill()
        process.wait()
    world.run()
    assert world.hashes() == wanted
