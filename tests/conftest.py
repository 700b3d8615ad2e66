"""Before the tests begin: signals as a terminal sets them, and in a whole run the largest kernels compiled once."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SHARED = (  # files whose tests share something that is dear to make: each stays with one worker, and begins early
    "system/test_first_light.py",
    "third_party/test_strangers_effect.py",
    "third_party/test_strangers_package.py",
    "reference/test_reference_bench.py",
    "studies/test_frf_methods_page.py",
    "studies/test_model_ladder.py",
)
SIMULATOR = [sys.executable, "-c", "from robid_core.mechanics import warm_up; warm_up()"]
LOCAL_METHODS = [
    *(sys.executable, "-m", "pytest", "-n0", "-q", "-p", "no:cacheprovider"),
    str(HERE / "robid_core" / "estimation" / "response" / "local" / "test_between_blocks.py"),
]


def pytest_configure(config: pytest.Config) -> None:
    """Let signals through, also to child processes, and warm the caches up (three seconds where they are warm).

    A shell lets what it starts in the background ignore SIGINT; a run that ignores a signal cannot be tested with it.
    A run of named tests compiles what it needs itself.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS and not config.option.collectonly
    if whole and not hasattr(config, "workerinput") and config.getoption("numprocesses", None):
        started = [
            subprocess.Popen(command, cwd=HERE.parent, stdout=subprocess.DEVNULL)
            for command in (SIMULATOR, LOCAL_METHODS)
        ]
        for process in started:
            process.wait()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the tests of some files together, and put them first: who begins late with them keeps the other waiting."""
    for item in items:
        file = item.path.relative_to(HERE).as_posix()
        if file in SHARED:
            item.add_marker(pytest.mark.xdist_group("third_party" if "third_party" in file else file))
    items.sort(key=lambda item: item.path.relative_to(HERE).as_posix() not in SHARED)
