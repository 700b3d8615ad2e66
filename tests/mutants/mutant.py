"""A broken mutant: a line of the sources, what breaks it, and the test that must fail then; tried on a copy."""

from __future__ import annotations

import enum
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
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

    @property
    def has_its_test(self) -> bool:
        """Whether the test that shall notice is there."""
        file, _, name = self.test.partition("::")
        return f"def {name}(" in (ROOT / file).read_text(encoding="utf-8")


class Fate(enum.Enum):
    """What becomes of a mutant: caught by a test that fails, by one that dies of it, by the time limit, or not."""

    FAILS = "the test fails"
    CRASHES = "the test's process ends"
    HANGS = "the time limit"
    SURVIVES = "SURVIVES"


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


def tried(mutant: Mutant, copy: Path) -> tuple[Fate, str]:
    """Break the line in the copy and run the test: what became of it, and what pytest said where it survived."""
    file = copy / mutant.file
    sound = file.read_text(encoding="utf-8")
    file.write_text(sound.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        done = pytest_in(copy, mutant.test)
    except subprocess.TimeoutExpired:
        return Fate.HANGS, ""
    finally:
        file.write_text(sound, encoding="utf-8")
    summed_up = " passed" in done.stdout or " skipped" in done.stdout
    if done.returncode < 0 or "KeyboardInterrupt" in done.stdout or (not done.returncode and not summed_up):
        return Fate.CRASHES, ""
    if done.returncode == 1:  # tests failed
        return Fate.FAILS, ""
    return Fate.SURVIVES, f"exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"


def count(mutants: Iterable[Mutant]) -> Counter[Fate]:
    """Try mutants in a fresh copy, a line each; return how many had which fate."""
    fates: Counter[Fate] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = copy_sources(Path(folder))
        for mutant in mutants:
            fate, words = tried(mutant, copy)
            fates[fate] += 1
            print(f"{fate.value}: {mutant.name} ({mutant.test})", words, flush=True)
    return fates
