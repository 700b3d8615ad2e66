"""The table of faults is what the tests say, every line that a mutant breaks stands, and one is caught.

`tests/mutants` tries them all."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from faults.fault import Fault, fault, faults_in
from faults.table import KINDS, ROOT, TABLE, table
from mutants.mutant import Fate, copy_sources, pytest_in, tried
from mutants.run import TABLE as FATES, read_fates

FAULTS = faults_in(ROOT / "tests", ROOT)
BROKEN = [one for one in FAULTS if one.mutant is not None]
QUICK = "tests/robid_core/artifacts/test_seal.py::test_a_changed_byte_anywhere_is_told_before_hdf5_sees_it"


def identifier(one: Fault) -> str:
    return f"{one.identifier}-{one.mutant.name if one.mutant else one.test}"


def test_the_table_is_up_to_date() -> None:
    assert TABLE.read_text(encoding="utf-8") == table(FAULTS, read_fates(FATES)), (
        "run python tests/faults/table.py"
    )


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
    assert tried(mutant, copy)[0] is Fate.ASSERTION
