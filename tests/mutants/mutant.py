"""A broken mutant: a line of the sources, what breaks it, and the test that must fail then; tried on a copy."""

from __future__ import annotations

import enum
import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SOURCES = ("robid_core", "plugins", "adapters", "tests")
LONGEST_S = 180  # of one test; kernels are compiled in the copy by then
IDLE = 6  # a test that hangs without the mutant takes less than a sixth of that with it


class Mutant(NamedTuple):
    """A line, what breaks it, and the test that notices."""

    name: str
    file: str
    old: str
    new: str
    test: str

    @property
    def key(self) -> str:
        """What it is known by in a table: another line, or another test, is another mutant."""
        return hashlib.sha256(repr(tuple(self)).encode()).hexdigest()[:12]

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
    """What becomes of a mutant.

    A test fails because something is not as it must be (ASSERTION) or by another error (ERROR); its process ends; it
    takes longer than it may, though without the mutant it is quick; or nothing is noticed.
    """

    ASSERTION = "assertion"
    ERROR = "error"
    CRASHES = "process end"
    HANGS = "time limit"
    SURVIVES = "SURVIVES"


def copy_sources(folder: Path) -> Path:
    """Copy the sources, and kernels that are compiled, where a process finds them before the installed ones."""
    for name in SOURCES:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("*.pyc"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def copy_for_many(folder: Path) -> Path:
    """Copy them with byte code that knows its source by content: what no mutant touches is not compiled for each."""
    copy_sources(folder)
    compiling = [sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "checked-hash", "."]
    subprocess.run(compiling, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder


def pytest_in(copy: Path, *tests: str) -> subprocess.CompletedProcess[str]:
    """Run tests on copied sources, a test at a time, until one fails; TimeoutExpired where one hangs."""
    paths = [str(copy / name) for name in (".", "plugins", "adapters")]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        "PYTHONDONTWRITEBYTECODE": "1",
        "COLUMNS": "500",  # the summary in whole lines
    }
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
    """Break the line in the copy and run the test: what became of it, and in words by what, or what pytest said."""
    file = copy / mutant.file
    sound = file.read_text(encoding="utf-8")
    file.write_text(sound.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        done = pytest_in(copy, mutant.test)
    except subprocess.TimeoutExpired:
        done = None
    finally:
        file.write_text(sound, encoding="utf-8")
    if done is None:
        began = time.monotonic()
        quick = not pytest_in(copy, mutant.test).returncode and time.monotonic() - began < LONGEST_S / IDLE
        return (Fate.HANGS, "") if quick else (Fate.SURVIVES, "the computer was too busy to tell")
    summed_up = re.search(r" (passed|failed|skipped|errors?)\b", done.stdout)
    interrupted = re.search(r"^!+ \S*KeyboardInterrupt !+$", done.stdout, re.MULTILINE)
    if done.returncode < 0 or interrupted or (done.returncode < 2 and not summed_up):
        return Fate.CRASHES, ""
    if done.returncode == 1:  # tests failed
        return _failure(done.stdout)
    return Fate.SURVIVES, f"exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"


def _failure(said: str) -> tuple[Fate, str]:
    """Tell an assertion of the test from an error that the mutant raised, by pytest's summary."""
    found = re.search(r"^(?:FAILED|ERROR) [^\s\[]+(?:\[.*?\])?(?: - (.*))?$", said, re.MULTILINE)
    words = (found[1] if found else "") or ""
    if re.match(r"assert|AssertionError|Failed: ", words):
        return Fate.ASSERTION, ""
    return Fate.ERROR, words.partition(":")[0]
