"""Kernels on disk survive processes that compile at once and processes that are killed, and are never stale."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from faults.fault import fault
from oracles.quick_start import QuickProcess

from robid_core.compiled.machine_code import VERSIONS, cache_folder

KERNEL = "from robid_core.compiled.kernel import kernel\n\n\n@kernel\ndef plus(x):\n    return x + {number}\n"
# Ends the process at once after so many files of the cache are written: index and machine code of one function.
KILLED = """
import contextlib, os, sys
from numba.core.caching import IndexDataCacheFile
write, written = IndexDataCacheFile._open_for_write, []
@contextlib.contextmanager
def write_and_die(self, path):
    with write(self, path) as file:
        yield file
    written.append(path)
    if len(written) == int(sys.argv[1]):
        os._exit(9)
IndexDataCacheFile._open_for_write = write_and_die
"""
CALL = "import edited_kernel; print(edited_kernel.plus(0.0), dict(edited_kernel.plus.stats.cache_hits))"
# Two processes that add different signatures meet between reading the index and writing it, unless one has to wait.
MEET = """
import sys, time
from pathlib import Path
from numba.core.caching import IndexDataCacheFile
load = IndexDataCacheFile._load_index
import edited_kernel
def load_and_meet(self):
    found = load(self)
    mark = Path(sys.argv[1])
    (mark / sys.argv[2]).touch()
    deadline = time.monotonic() + 1.0
    while len(list(mark.iterdir())) < 2 and time.monotonic() < deadline:
        time.sleep(0.005)
    return found
save = edited_kernel.plus._cache._save_overload
def meeting(signature, data):
    IndexDataCacheFile._load_index = load_and_meet  # only now: before, the cache is looked at as ever
    save(signature, data)
edited_kernel.plus._cache._save_overload = meeting
print(edited_kernel.plus(float(sys.argv[2]) if "." in sys.argv[2] else int(sys.argv[2])))
"""

Start = Callable[..., QuickProcess]


@pytest.fixture(name="environment")
def own_cache(tmp_path: Path) -> dict[str, str]:
    search = os.pathsep.join([str(tmp_path), *sys.path])
    return {**os.environ, "PYTHONPATH": search, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}


@pytest.fixture
def run(environment: dict[str, str]) -> Start:
    def start(code: str, *arguments: str) -> QuickProcess:
        return QuickProcess(["-c", code, *arguments], env=environment, bare=True)

    return start


def said(process: QuickProcess) -> str:
    return process.communicate(timeout=60)[0].strip()


def edit(folder: Path, number: str) -> None:
    """Write the kernel, with a time stamp of its own."""
    path = folder / "edited_kernel.py"
    path.write_text(KERNEL.format(number=number))
    os.utime(path, (1e9 + float(number), 1e9 + float(number)))


@pytest.mark.parametrize("at", [1, pytest.param(2, marks=pytest.mark.full)])
def test_a_process_killed_while_it_writes_leaves_no_stale_kernel(tmp_path: Path, run: Start, at: int) -> None:
    edit(tmp_path, "1.0")
    assert said(run(CALL)).startswith("1.0")
    edit(tmp_path, "2.0")
    killed = run(KILLED + CALL, str(at))
    assert said(killed) == ""
    assert killed.returncode == 9
    assert said(run(CALL)).startswith("2.0")
    assert said(run(CALL)) == "2.0 {(float64,): 1}", "found on disk"


def test_two_signatures_compiled_at_once_both_stay_and_keep_their_code(tmp_path: Path, run: Start) -> None:
    edit(tmp_path, "1.5")
    (tmp_path / "meeting").mkdir()
    processes = [run(MEET, str(tmp_path / "meeting"), argument) for argument in ("4", "4.25")]
    assert [said(process) for process in processes] == ["5.5", "5.75"]
    again = "import edited_kernel as m; print(m.plus(4), m.plus(4.25), sum(m.plus.stats.cache_hits.values()))"
    assert said(run(again)) == "5.5 5.75 2"


def codes(folder: Path) -> list[Path]:
    return sorted((folder / "cache").rglob("*.nbc"))


@pytest.mark.full
def test_machine_code_of_sources_of_long_ago_is_removed(tmp_path: Path, run: Start) -> None:
    for number in range(1, VERSIONS + 2):
        edit(tmp_path, f"{number}.0")
        assert said(run(CALL)).startswith(f"{number}.0")
    assert len(codes(tmp_path)) == VERSIONS
    assert said(run(CALL)) == f"{number}.0 {{(float64,): 1}}", "the newest is kept"


def test_the_same_source_in_another_place_finds_the_machine_code(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    """In processes that Python starts, each with a hash seed of its own."""

    def answer(code: str) -> str:
        command = [sys.executable, "-c", code]
        return subprocess.run(command, env=environment, capture_output=True, text=True).stdout.strip()

    edit(tmp_path, "2.0")
    assert answer(CALL) == "2.0 {}"
    other = tmp_path / "other"
    other.mkdir()
    (tmp_path / "edited_kernel.py").rename(other / "edited_kernel.py")
    os.utime(other / "edited_kernel.py", (5e8, 5e8))
    assert answer(f"import sys; sys.path.insert(0, {str(other)!r}); {CALL}") == "2.0 {(float64,): 1}"
    assert len(codes(tmp_path)) == 1


def test_a_constant_of_another_file_decides_what_is_found(tmp_path: Path, run: Start) -> None:
    header = "from robid_core.compiled.kernel import kernel\nimport {0}\n"
    body = "from constants import SIZE\n\n\n@kernel\ndef plus(x):\n    return x + SIZE\n"
    (tmp_path / "edited_kernel.py").write_text(header.format("constants") + body)
    for size in ("1.0", "2.0", "1.0"):
        (tmp_path / "constants.py").write_text(f"SIZE = {size}\n")
        os.utime(tmp_path / "constants.py", (1e9 + float(size), 1e9 + float(size)))
        assert said(run(CALL)).startswith(size)
    assert said(run(CALL)) == "1.0 {(float64,): 1}"


@pytest.mark.parametrize(
    ("suffix", "damage"),
    [
        ("nbi", "cut"),
        pytest.param("nbc", "flipped", marks=pytest.mark.full),
        pytest.param("nbc", "empty", marks=pytest.mark.full),
    ],
)
def test_a_damaged_file_is_compiled_anew(tmp_path: Path, run: Start, suffix: str, damage: str) -> None:
    edit(tmp_path, "3.0")
    assert said(run(CALL)) == "3.0 {}"
    (path,) = (tmp_path / "cache").rglob(f"*.{suffix}")
    content = bytearray(path.read_bytes())
    if damage == "flipped":
        content[len(content) // 2] ^= 0x10
    path.write_bytes({"cut": content[: len(content) // 2], "flipped": content, "empty": b""}[damage])
    assert said(run(CALL)).startswith("3.0")
    assert said(run(CALL)) == "3.0 {(float64,): 1}"


def test_a_folder_that_cannot_be_written_costs_time_only(tmp_path: Path, run: Start) -> None:
    """As on a full disk: writing fails, the kernel is compiled."""
    edit(tmp_path, "4.0")
    full = "from numba.core.caching import IndexDataCacheFile as F\ndef full(*_):\n    raise OSError(28, 'full')\n"
    assert said(run(f"{full}F._open_for_write = full\n{CALL}")) == "4.0 {}"
    assert codes(tmp_path) == []


def test_an_index_that_names_a_type_which_is_no_more_is_made_anew(tmp_path: Path, run: Start) -> None:
    """As after an upgrade that moved a tuple of arrays to another module: numba's index names its arguments' types."""
    pair = "from typing import NamedTuple\n\n\nclass Pair(NamedTuple):\n    one: float\n    two: float\n"
    kernel = "from robid_core.compiled.kernel import kernel\n\n\n@kernel\ndef added(p):\n    return p.one + p.two\n"
    call = "import adding, {0}; print(adding.added({0}.Pair(1.0, 2.0)), sum(adding.added.stats.cache_hits.values()))"
    (tmp_path / "adding.py").write_text(kernel)
    (tmp_path / "before.py").write_text(pair)
    assert [said(run(call.format("before"))) for _ in range(2)] == ["3.0 0", "3.0 1"]
    (tmp_path / "before.py").rename(tmp_path / "after.py")
    assert [said(run(call.format("after"))) for _ in range(2)] == ["3.0 0", "3.0 1"]


@fault(
    "R04",
    sees="a user without a home, as in a container: kernels are kept in the folder for temporary files",
    mutant=(
        "robid_core/compiled/machine_code.py",
        "contextlib.suppress(RuntimeError):  # a user",
        "contextlib.suppress(KeyError):  # a user",
    ),
)
def test_R04_a_user_without_a_home_has_a_folder_for_kernels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", unknown)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert cache_folder.__wrapped__("kernels").parent == tmp_path
