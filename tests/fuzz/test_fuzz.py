"""Damaged files of every format: read, told or refused with the file's name; never a crash, a hang or a bug of ours.

A plain run damages a few files of each format, and those that once led to a fault. `pytest -m full tests/fuzz` takes
10^5 of each (`python tests/fuzz/run.py all 100000 --table tests/fuzz/counts.csv` does, too, goes on where it was
stopped, and keeps what came of them).
"""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz.damage import damaged
from fuzz.judgement import GOOD
from fuzz.run import COLUMNS, continue_table, fuzz, fuzz_in_memory, read_counts
from fuzz.samples import SAMPLES

COUNTS = Path(__file__).with_name("counts.csv")
FEW, MANY = 12, 100_000
# Numbers of damage that led to something else than a message once, by format.
FOUND = {
    "npz": (1241, 3895),  # an entry of the directory swallowed the next one
    "npz_plain": (1840,),
    "mat_packed": (
        7000509,
        8092,
    ),  # cut right behind the header: no variables, and nothing told; behind a variable
    "bag_mcap": (7000001, 7000013, 7000038),  # chunks without a checksum, and nothing told
    "hdf5": (5222,),  # a name that is no text
    "mat_plain": (1932, 2411, 3192),  # scipy ended the process, by SIGSEGV and SIGBUS
    "mcap_foreign": (3, 58, 129, 138, 176, 218),  # the summary was believed
    "mcap_log": (2, 3, 91, 135, 176, 263),
}
EXTRAS = {"parquet": "pyarrow", "rosbag": "rosbags"}


@pytest.mark.parametrize("name", SAMPLES)
def test_damaged_files_are_read_told_or_refused(name: str, tmp_path: Path) -> None:
    pytest.importorskip(EXTRAS.get(SAMPLES[name][1], "numpy"))
    numbers = [*range(FEW), *FOUND.get(name, ())]
    tally = fuzz(name, numbers, tmp_path)
    assert not tally.faults
    assert sum(tally.counts.values()) == len(numbers)
    assert tally.counts.get("read", 0) < len(numbers)  # some damage was noticed


@pytest.mark.full
@pytest.mark.parametrize("name", SAMPLES)
def test_very_many_damaged_files_are_read_told_or_refused(name: str) -> None:
    assert not fuzz_in_memory(name, range(MANY)).faults


def test_the_table_counts_every_file_once() -> None:
    rows = read_counts(COUNTS)
    assert set(rows) == set(SAMPLES)
    for name, row in rows.items():
        assert row["files"] >= MANY
        assert row["files"] == sum(row[outcome] for outcome in GOOD)
        assert row["read"] < row["files"]
        assert not SAMPLES[name][3] or not row["other values"], f"{name}: its checksums cover everything"


def test_a_table_goes_on_where_it_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fuzz.run.BLOCK", 4)
    table, whole = tmp_path / "counts.csv", tmp_path / "whole.csv"
    continue_table("json", 4, table)
    continue_table("json", 9, table)
    continue_table("json", 9, whole)
    parts, at_once = read_counts(table)["json"], read_counts(whole)["json"]
    assert parts["files"] == at_once["files"] == 9
    assert {name: parts[name] for name in GOOD} == {name: at_once[name] for name in GOOD}
    assert tuple(parts) == COLUMNS[1:]


def test_a_block_with_a_fault_is_not_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fuzz.run.BLOCK", 4)
    monkeypatch.setattr("fuzz.judgement.ALLOWED", ())
    tally = continue_table("json", 8, tmp_path / "counts.csv")
    assert "refused with exit code 5" in tally.faults[0]
    assert not read_counts(tmp_path / "counts.csv")


def test_damage_is_the_same_for_the_same_number_and_changes_something() -> None:
    data = bytes(range(256)) * 20
    found = [damaged(data, number) for number in range(200)]
    assert found == [damaged(data, number) for number in range(200)]
    assert all(content != data for content, _ in found)
    assert len({content for content, _ in found}) > 190
