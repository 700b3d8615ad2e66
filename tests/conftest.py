"""Before the tests begin: one thread a process, signals as a terminal sets them; what many tests need is compiled once.

Makes `tests/oracles` importable as `oracles`: machinery that shares no code with the simulator.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import pytest

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: two workers use two cores

HERE = Path(__file__).parent
if str(HERE) not in sys.path:
    sys.path.append(str(HERE))
DEAR = (  # files that begin first: a worker that begins late with one keeps the other waiting
    "system/test_first_light.py",
    "examples/test_emps.py",
    "third_party/test_strangers_effect.py",
    "system/test_hidden_effects.py",
    "plugins/robid_fit/test_torque_residual.py",  # not beside the worked example: both would compile the same kernels
    "plugins/robid_diagnosis/test_effects.py",
    "blind/test_hidden.py",
    "adapters/robid_dask/test_dask_batches.py",
    "system/test_stops.py",
    "system/test_host_deaths.py",
    "reference/test_reference_bench.py",
    "robid_core/run/test_limits.py",
    "robid_core/run/test_two_runs.py",
    "plugins/robid_effects/test_every_effect.py",
)
SOURCES = [sys.executable, "-m", "compileall", "-q", "robid_core", "plugins", "adapters"]
SIMULATOR = [
    sys.executable,
    "-c",
    "from robid_core.run.compilation import compile_ahead; compile_ahead(jobs=1)",
]
LOCAL_METHODS = [
    *(sys.executable, "-m", "pytest", "-n0", "-q", "-p", "no:cacheprovider"),
    str(HERE / "robid_core" / "estimation" / "response" / "local" / "test_between_blocks.py"),
]


def pytest_configure(config: pytest.Config) -> None:
    """Let signals through, also to child processes, and warm the caches up (three seconds where they are warm).

    A shell lets what it starts in the background ignore SIGINT; a run that ignores a signal cannot be tested with it.
    A run of named tests compiles what it needs itself. Python's own byte code is kept beside the machine code even
    where Python was told to keep none: hundreds of processes would read all sources anew.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS and not config.option.collectonly
    if whole and not hasattr(config, "workerinput") and config.getoption("numprocesses", None):
        started = [
            subprocess.Popen(command, cwd=HERE.parent, stdout=subprocess.DEVNULL)
            for command in (SIMULATOR, LOCAL_METHODS, SOURCES)
        ]
        for process in started:
            process.wait()


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Keep the byte code of the tests, too, which pytest compiles anew where Python was told to keep none."""
    told, sys.dont_write_bytecode = sys.dont_write_bytecode, False
    try:
        return (yield)
    finally:
        sys.dont_write_bytecode = told


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the dear files first, the dearest in front; `--dist loadfile` keeps a file with one worker."""
    items.sort(key=lambda item: rank(item.path.relative_to(HERE).as_posix()))


def rank(file: str) -> int:
    """Return the place of a file among the dear ones, or behind them."""
    return DEAR.index(file) if file in DEAR else len(DEAR)
