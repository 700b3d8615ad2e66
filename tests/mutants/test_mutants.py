"""Every mutant's line stands, every mutant is caught by its test, and the table says by what.

A plain run sees that every line and every test is still there. `pytest -m full tests/mutants` copies the sources,
breaks one line at a time and runs the test that shall notice, as `run.py` does, which writes the table.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mutants.every import NAMED, every_mutant
from mutants.mutant import ROOT, Fate, Mutant, copy_for_many, pytest_in, tried
from mutants.run import TABLE, read_fates

MUTANTS = [one for mutants in NAMED.values() for one in mutants]
EVERY = [one for mutants in every_mutant().values() for one in mutants]


def mutant_name(mutant: Mutant) -> str:
    return mutant.name.replace(" ", "_")


@pytest.mark.parametrize("mutant", MUTANTS, ids=mutant_name)
def test_the_line_that_a_mutant_breaks_stands_once_and_its_test_is_there(mutant: Mutant) -> None:
    assert mutant.stands_once
    assert mutant.has_its_test


def test_no_two_mutants_are_the_same() -> None:
    assert len({one.key for one in EVERY}) == len(EVERY)


def test_no_mutant_of_the_table_survived() -> None:
    fates = read_fates(TABLE)
    assert fates
    assert {row.killed_by for row in fates.values()} <= {fate.value for fate in Fate} - {Fate.SURVIVES.value}


def small_copy(folder: Path, body: str) -> tuple[Path, Mutant]:
    """Return sources of one line, and a mutant of it that a test of this body shall notice."""
    (folder / "adapters").mkdir(parents=True)
    (folder / "adapters" / "room.py").write_text("ANSWER = 42\n")
    (folder / "test_room.py").write_text(
        "import os, time\nimport pytest\nfrom room import ANSWER\n\n\n"
        f"@pytest.mark.parametrize('value', ['a - word'])\ndef test_room(value):\n    {body}\n"
    )
    return folder, Mutant(
        "another answer", "adapters/room.py", "ANSWER = 42", "ANSWER = 41", "test_room.py::test_room"
    )


@pytest.mark.parametrize(
    ("body", "fate", "words"),
    [
        ("assert ANSWER == 42, 'no'", Fate.ASSERTION, ""),
        pytest.param(
            "with pytest.raises(KeyError): {41: 1}[ANSWER]", Fate.ASSERTION, "", marks=pytest.mark.full
        ),
        ("{42: 1}[ANSWER]", Fate.ERROR, "KeyError"),
        ("ANSWER == 42 or os._exit(1)", Fate.CRASHES, ""),
        pytest.param("ANSWER == 42 or os.abort()", Fate.CRASHES, "", marks=pytest.mark.full),
        pytest.param("if ANSWER != 42: raise KeyboardInterrupt", Fate.CRASHES, "", marks=pytest.mark.full),
        pytest.param("assert ANSWER == 42, 'KeyboardInterrupt'", Fate.ASSERTION, "", marks=pytest.mark.full),
        pytest.param("ANSWER == 42 or time.sleep(60)", Fate.HANGS, "", marks=pytest.mark.full),
        ("assert ANSWER", Fate.SURVIVES, "exit code 0"),
    ],
)
def test_the_end_of_a_mutant_is_told_from_the_others(
    body: str, fate: Fate, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mutants.mutant.LONGEST_S", 10)
    monkeypatch.setattr("mutants.mutant.IDLE", 1)
    copy, mutant = small_copy(tmp_path, body)
    found, said = tried(mutant, copy)
    assert found is fate
    assert said.startswith(words)
    assert (copy / mutant.file).read_text() == "ANSWER = 42\n"


def test_processes_that_tests_start_have_the_sources_of_the_copy(tmp_path: Path) -> None:
    """Else a mutant would run in the test alone, and the processes of `quick_start.py` would be sound."""
    commands = tmp_path / "robid_core" / "commands"
    commands.mkdir(parents=True)
    for name in ("__init__", "pipeline", "commands/__init__", "commands/app"):
        (tmp_path / "robid_core" / f"{name}.py").touch()
    asked = "import robid_core; print(robid_core.__file__)"
    code = f"from oracles.quick_start import run; print(run(['-c', {asked!r}], env={{}}).stdout)"
    search = os.pathsep.join([str(tmp_path), str(ROOT / "tests")])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": search},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(done.stdout.strip()).is_relative_to(tmp_path)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_for_many(tmp_path_factory.mktemp("mutant"))


@pytest.mark.full
def test_the_sound_copy_passes(copy: Path) -> None:
    done = pytest_in(copy, *dict.fromkeys(mutant.test for mutant in EVERY))
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


@pytest.mark.full
@pytest.mark.parametrize("mutant", EVERY, ids=mutant_name)
def test_a_mutant_is_caught(
    mutant: Mutant, copy: Path, record_property: Callable[[str, object], None]
) -> None:
    fate, words = tried(mutant, copy)
    record_property("caught by", fate.value)
    assert fate is not Fate.SURVIVES, words
