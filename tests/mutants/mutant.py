"""A broken mutant: a line of the sources, what breaks it, and the test that must fail then; tried on a copy."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SOURCES = ("robid_core", "plugins", "adapters", "tests")
LONGEST_S = 180  # of one test; kernels are compiled in the copy by then


class Mutant(NamedTuple):
    """A line, what breaks it, and the test that notices."""

    name: str
    file: str
    old: str
    new: str
    test: str

    @property
    def stands_once(self) -> bool:
        """Whether its line is there, and can be no other."""
        return (ROOT / self.file).read_text(encoding="utf-8").count(self.old) == 1


def copy_sources(folder: Path) -> Path:
    """Copy the sources into a folder, where a process finds them before the installed ones."""
    for name in SOURCES:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def pytest_in(copy: Path, *tests: str) -> subprocess.CompletedProcess[str]:
    """Run tests on copied sources, a test at a time, until one fails; TimeoutExpired where one hangs."""
    paths = [str(copy / name) for name in (".", "plugins", "adapters")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-n0", "-p", "no:cacheprovider", *tests]
    return subprocess.run(
        command,
        cwd=copy,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=LONGEST_S * max(len(tests), 1),
    )


def survival(mutant: Mutant, copy: Path) -> str:
    """Break the line in the copy and run the test: empty where it is caught, else what pytest said."""
    file = copy / mutant.file
    sound = file.read_text(encoding="utf-8")
    file.write_text(sound.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        done = pytest_in(copy, mutant.test)
    except subprocess.TimeoutExpired:
        return ""  # it hangs: caught
    finally:
        file.write_text(sound, encoding="utf-8")
    crashed = done.returncode < 0
    caught = crashed or done.returncode == 1 or "KeyboardInterrupt" in done.stdout  # 1: tests failed
    return "" if caught else f"exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
