"""Two runs in one folder: the second waits or is told who is there, and a lock dies with its holder (R05)."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault
from oracles.quick_start import QuickProcess

from robid_core.errors import StoreError
from robid_core.interruption import held, signals_as_interrupt
from robid_core.run import ALL
from robid_core.run.lock import run_lock
from robid_core.run.progress import Silence

LOCK = "robid_core/run/lock.py"
ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]


def start(world: Any, **options: Any) -> QuickProcess:
    return QuickProcess(world.command(**options)[1:], env=world.environment)


def wait_for(world: Any, stage: str, process: QuickProcess) -> None:
    deadline = time.monotonic() + 60
    while not (world.calls.exists() and stage in world.calls.read_text().split()):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_second_run_is_told_who_holds_the_folder_or_waits(world: Any) -> None:
    world.say("{use: strange.estimate}", "{use: strange.estimate, with: {hold: 1.2}}")
    first = start(world)
    wait_for(world, "fit", first)
    with pytest.raises(
        StoreError, match=rf"process {first.pid} on .* is running here since 20\d\d-"
    ) as caught:
        world.run(wait=False)
    assert caught.value.exit_code == 7
    others = [start(world) for _ in range(2)]
    for process in (first, *others):
        process.communicate(timeout=60)
        assert process.returncode == 0
    assert sorted(world.ran()) == sorted(ORDER)  # each stage ran once in all


def test_a_killed_holder_leaves_no_lock(world: Any) -> None:
    world.say("{use: strange.estimate}", "{use: strange.estimate, with: {hold: 60.0}}")
    first = start(world)
    wait_for(world, "fit", first)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    world.say("hold: 60.0", "hold: 0.0")
    assert world.run(wait=False).exit_code == 0


@fault(
    "R05",
    sees="exit 7: the run's folder was deleted, moved or replaced; what another run makes there stays as it is",
    mutant=(
        LOCK,
        "        if not _stands_at(path, descriptor):\n            raise",
        "        if False:\n            raise",
    ),
)
def test_R05_a_run_whose_folder_was_replaced_writes_nothing_into_the_new_one(world: Any) -> None:
    old = world.folder.with_name("old")

    class Mover(Silence):
        def begin(self, stage: str, index: int, count: int, reasons: tuple[str, ...]) -> None:
            if stage == "fit":
                world.folder.rename(old)
                assert world.run().exit_code == 0

    with pytest.raises(StoreError, match="was deleted, moved or replaced while this run was in it"):
        world.run(listener=Mover(), force=(ALL,))
    hashes = world.hashes()
    world.ran()
    assert world.run().exit_code == 0
    assert world.ran() == []
    assert world.hashes() == hashes


@fault(
    "R05",
    sees="a run that waited for a folder which was replaced meanwhile waits for the new one",
    mutant=(LOCK, "    while not _stands_at(path, descriptor):", "    while False:"),
)
def test_R05_a_lock_whose_file_is_gone_is_no_lock(tmp_path: Path) -> None:
    path = tmp_path / "run" / "lock"
    path.parent.mkdir()
    with path.open("w") as first:
        fcntl.flock(first, fcntl.LOCK_EX)

        def replaced(holder: str) -> None:
            path.unlink()
            first.close()

        with run_lock(path, wait=True, waiting=replaced), path.open() as file, pytest.raises(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_waiting_says_once_for_whom(tmp_path: Path) -> None:
    path = tmp_path / "run" / "store" / "lock"
    path.parent.mkdir(parents=True)
    code = "import fcntl, os, sys, time\nfd = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)\n"
    code += "fcntl.flock(fd, fcntl.LOCK_EX); print('held', flush=True); time.sleep(0.5)"
    with subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        heard: list[str] = []
        with run_lock(path, wait=True, waiting=heard.append):
            assert heard == ["another process is running here"]  # it wrote no name
            with path.open() as file, pytest.raises(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            assert str(os.getpid()) in path.read_text()
    assert path.read_text() == ""


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # what nohup does
    try:
        with signals_as_interrupt():
            signal.raise_signal(signal.SIGHUP)
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


UNLUCKY = """\


class Unlucky:
    def __del__(self):
        import signal

        signal.raise_signal(signal.SIGHUP)


class Measure("""
SWALLOWED = """\
        try:
            import signal

            signal.raise_signal(signal.SIGTERM)
        except BaseException:
            pass
        n_config"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            'called("acquire")\n',
            'called("acquire")\n        Unlucky()\n',
        ),  # Python drops what is raised there
        ("        n_config", SWALLOWED),  # the stage does
    ],
)
def test_D18_an_interrupt_that_got_lost_ends_the_run_at_the_next_progress(
    world: Any, old: str, new: str
) -> None:
    world.edit("\n\nclass Measure(", UNLUCKY)
    text = world.source.read_text().replace(old, new, 1)
    world.source.write_text(text)
    process = start(world)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert world.ran() == ["where", "acquire"]
    manifest = json.loads((world.folder / "manifest.json").read_text())
    assert manifest["status"] == "interrupted"
    assert list(manifest["stages"]) == ["where"]  # the stage itself was ended


def test_D18_an_interrupt_ends_the_waiting_for_another_run(tmp_path: Path) -> None:
    path = tmp_path / "run" / "store" / "lock"
    path.parent.mkdir(parents=True)
    with path.open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)

        def wait_in_vain() -> None:
            with held():  # it is lost, as in a weakref callback
                signal.raise_signal(signal.SIGINT)
            with run_lock(path, wait=True, waiting=lambda holder: None):
                raise AssertionError("the lock was held")

        with signals_as_interrupt(), pytest.raises(KeyboardInterrupt):
            wait_in_vain()


def test_sigterm_interrupts_and_the_next_run_goes_on(world: Any) -> None:
    world.say("{use: strange.estimate}", "{use: strange.estimate, with: {hold: 60.0}}")
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        process = start(world)
        wait_for(world, "fit", process)
        process.send_signal(number)
        process.communicate(timeout=60)
        assert process.returncode == 130
        assert '"status": "interrupted"' in (world.folder / "manifest.json").read_text()
        assert world.ran()[-1] == "fit"
    world.say("hold: 60.0", "hold: 0.0")
    world.run()
    assert world.ran() == ["fit", "choose", "page"]
