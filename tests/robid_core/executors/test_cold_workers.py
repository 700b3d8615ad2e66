"""Workers that start without compiled laws, and compile the same ones at once, compute the right bytes."""

from __future__ import annotations

import importlib.util
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("cold_worker.py")


def worker(cache: Path, start: Path, **variables: str) -> subprocess.Popen[str]:
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        **variables,
    }
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(cache), str(start)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )


def ready(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"


def answer(process: subprocess.Popen[str], patience_s: float = 120.0) -> tuple[str, list[int]]:
    lines = process.communicate(timeout=patience_s)[0].split("\n")
    assert process.returncode == 0
    return lines[0], [int(word) for word in lines[1].split()]


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Compute in this process, with the laws as they are compiled here."""
    spec = importlib.util.spec_from_file_location("cold_worker", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: str = module.digest(tmp_path_factory.mktemp("here"))
    return found


@pytest.mark.full
def test_two_cold_workers_compile_at_once_and_a_third_finds_their_work(tmp_path: Path, expected: str) -> None:
    cache, start = tmp_path / "laws", tmp_path / "start"
    cache.mkdir()
    both = [worker(cache, start) for _ in range(2)]
    for process in both:
        ready(process)
    start.touch()
    answers = [answer(process) for process in both]
    assert [digest for digest, _ in answers] == [expected, expected]
    third = worker(cache, start)
    ready(third)
    digest, (n_entry, n_found) = answer(third)
    assert digest == expected
    assert n_entry == n_found > 4, "every law was read from disk"
    assert not [path for path in cache.rglob("*") if ".tmp" in path.name]


@pytest.mark.full
def test_workers_killed_while_they_compile_leave_nothing_wrong(tmp_path: Path, expected: str) -> None:
    cache, start, chance = tmp_path / "laws", tmp_path / "start", random.Random(4)
    cache.mkdir()
    start.touch()
    for _ in range(8):
        victim = worker(cache, start)
        ready(victim)
        time.sleep(chance.uniform(0.0, 4.0))
        victim.send_signal(signal.SIGKILL)
        victim.communicate()
    for _ in range(2):
        last = worker(cache, start)
        ready(last)
        assert answer(last)[0] == expected


@pytest.mark.full
def test_workers_that_compile_every_kernel_at_once_compute_the_right_bytes(
    tmp_path: Path, expected: str
) -> None:
    cache, start = tmp_path / "laws", tmp_path / "start"
    cache.mkdir()
    start.touch()
    for _ in range(2):  # compiled, then read
        both = [worker(cache, start, NUMBA_CACHE_DIR=str(tmp_path / "numba")) for _ in range(2)]
        for process in both:
            ready(process)
        assert [answer(process, 900.0)[0] for process in both] == [expected, expected]
