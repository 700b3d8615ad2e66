"""The table of faults is what the tests say, every line that a mutant breaks stands, and every mutant is caught."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from faults.fault import Fault, fault, faults_in
from faults.table import KINDS, ROOT, TABLE, table
from mutants.mutant import Fate, copy_sources, pytest_in, tried

FAULTS = faults_in(ROOT / "tests", ROOT)
BROKEN = [one for one in FAULTS if one.mutant is not None]
QUICK = "tests/robid_core/artifacts/test_seal.py::test_a_changed_byte_anywhere_is_told_before_hdf5_sees_it"


def identifier(one: Fault) -> str:
    return f"{one.identifier}-{one.mutant.name if one.mutant else one.test}"


def test_the_table_is_up_to_date() -> None:
    assert TABLE.read_text(encoding="utf-8") == table(FAULTS), "run python tests/faults/table.py"


def test_every_fault_has_an_id_of_the_list_and_says_what_is_seen() -> None:
    assert FAULTS
    for one in FAULTS:
        assert re.fullmatch(f"[{''.join(KINDS)}][0-9]{{2}}", one.identifier), one
        assert one.sees, one
        assert one.mutant is not None or one.without, one


@pytest.mark.parametrize("one", BROKEN, ids=identifier)
def test_the_line_that_a_mutant_breaks_stands_once(one: Fault) -> None:
    assert one.mutant is not None
    assert one.mutant.stands_once, one.mutant
    assert one.mutant.old != one.mutant.new


def test_a_fault_without_a_mutant_says_why() -> None:
    with pytest.raises(TypeError, match="A02: give a mutant"):
        fault("A02", sees="a message")


def test_a_mutant_of_a_seal_is_caught(tmp_path: Path) -> None:
    (mutant,) = [one.mutant for one in BROKEN if one.test == QUICK]
    assert mutant is not None
    copy = copy_sources(tmp_path)
    assert pytest_in(copy, mutant.test).returncode == 0
    assert tried(mutant, copy)[0] is Fate.FAILS


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_sources(tmp_path_factory.mktemp("mutant"))


@pytest.mark.full
def test_the_sound_copy_passes(copy: Path) -> None:
    done = pytest_in(copy, *dict.fromkeys(one.test for one in BROKEN))
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


@pytest.mark.full
@pytest.mark.parametrize("one", BROKEN, ids=identifier)
def test_a_mutant_is_caught(one: Fault, copy: Path, record_property: Callable[[str, object], None]) -> None:
    assert one.mutant is not None
    fate, words = tried(one.mutant, copy)
    record_property("caught by", fate.value)
    assert fate is not Fate.SURVIVES, words
