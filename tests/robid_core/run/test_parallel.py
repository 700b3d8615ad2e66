"""Parallel work gives the same bytes, its errors are told, and no process outlives the run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core.errors import ConfigurationError, DataRejected, PluginError
from robid_core.executors import process_executor

TASKS = """
import os
import numpy as np
from robid_core import DataRejected

def total(values, scale):
    values *= scale          # a task may change what it is given: it is a copy
    return np.sum(values, axis=0)

def threads():
    from threadpoolctl import threadpool_info
    import numba
    return [library["num_threads"] for library in threadpool_info()] + [numba.get_num_threads()], os.getpid()

def fail(number):
    if number % 2:
        raise DataRejected(f"line {number} is silent")
    return number

def die(number):
    os._exit(1)

class Box:
    def task(self):
        return 1
"""


@pytest.fixture
def tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (tmp_path / "strange_tasks.py").write_text(TASKS)
    monkeypatch.syspath_prepend(tmp_path)
    import strange_tasks  # type: ignore[import-not-found]

    yield strange_tasks
    sys.modules.pop("strange_tasks")


def test_one_and_two_processes_give_the_same_bits_in_order(tasks: Any) -> None:
    values = np.random.default_rng(0).normal(size=(1001, 40))
    arguments = [(values[::step, ::-2], 1.0 + step) for step in (1, 2, 3, 5)]
    with process_executor(jobs=1) as here, process_executor(jobs=2) as there:
        one, two = here(tasks.total, arguments), there(tasks.total, arguments)
        assert [a.tobytes() for a in one] == [a.tobytes() for a in two]
        assert np.isclose(one[2], 4.0 * values[::3, ::-2].sum(axis=0)).all()
        assert [a.strides for a in one] == [a.strides for a in two]
        for run in (here, there):
            with pytest.raises(DataRejected, match="line 1 is silent"):
                run(tasks.fail, [(0,), (1,), (2,), (3,)])
        (counts, first), (_, second) = there(tasks.threads, [(), ()])
        assert set(counts) == {1}
        assert os.getpid() not in (first, second)
        with pytest.raises(PluginError, match=r"worker process died while it ran strange_tasks\.die"):
            there(tasks.die, [(0,), (1,)])
        assert there(tasks.fail, [(0,), (2,)]) == [0, 2]  # a new pool


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_another_process_could_not_find_is_refused_everywhere(tasks: Any, jobs: int) -> None:
    with process_executor(jobs) as run:
        for function in (lambda: 1, tasks.Box().task):
            with pytest.raises(PluginError, match="cannot be a parallel task"):
                run(function, [()])


def test_a_negative_number_of_jobs_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="-1 jobs"), process_executor(-1):
        pass


def test_runs_with_one_and_two_processes_make_the_same_bytes(world: Any) -> None:
    world.run(jobs=1)
    before = world.hashes()
    subprocess.run(["rm", "-rf", str(world.folder)], check=True)
    world.run(jobs=2)
    assert world.hashes() == before


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_workers_die_with_a_killed_run(world: Any) -> None:
    world.say("{use: strange.estimate}", "{use: strange.estimate, with: {hold: 60.0}}")
    process = subprocess.Popen(world.command(jobs=2), env=world.environment)
    deadline = time.monotonic() + 60
    while not (world.calls.exists() and "fit" in world.calls.read_text().split()):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    children = [
        int(child) for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    ]
    assert len(children) >= 2
    process.send_signal(signal.SIGKILL)
    process.wait()
    while any(_alive(child) for child in children):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _alive(pid: int) -> bool:
    try:
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_libraries_are_held_to_one_thread_during_a_run_and_let_go_after(tmp_path: Path) -> None:
    code = textwrap.dedent("""
        import os
        import numpy
        from threadpoolctl import threadpool_info
        from robid_core.executors import one_thread
        def counts():
            return {library["filepath"]: library["num_threads"] for library in threadpool_info()}
        before = counts()
        with one_thread():
            assert set(counts().values()) == {1}
            assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
            import numba
            assert numba.get_num_threads() == 1
        assert counts().items() >= before.items()
        assert "OPENBLAS_NUM_THREADS" not in os.environ
    """)
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
