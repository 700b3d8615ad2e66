"""Before the workers of a whole run begin: the largest kernels are compiled once, side by side."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SIMULATOR = [sys.executable, "-c", "from robid_core.mechanics import warm_up; warm_up()"]
LOCAL_METHODS = [
    *(sys.executable, "-m", "pytest", "-n0", "-q", "-p", "no:cacheprovider"),
    str(HERE / "robid_core" / "estimation" / "response" / "local" / "test_between_blocks.py"),
]


def pytest_configure(config: pytest.Config) -> None:
    """Warm the caches up; with them warm it takes three seconds. A run of named tests compiles what it needs itself."""
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS and not config.option.collectonly
    if whole and not hasattr(config, "workerinput") and config.getoption("numprocesses", None):
        started = [
            subprocess.Popen(command, cwd=HERE.parent, stdout=subprocess.DEVNULL)
            for command in (SIMULATOR, LOCAL_METHODS)
        ]
        for process in started:
            process.wait()
