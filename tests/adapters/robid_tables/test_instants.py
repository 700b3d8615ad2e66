"""Dates and times of day as seconds, against Python's own calendar."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

import numpy as np
import pytest

from robid_tables.csv import CsvRecords
from robid_tables.instants import instants
from robid_tables.json import JsonRecords

MOMENT = datetime.datetime(2026, 3, 31, 23, 59, 59)
STEP = datetime.timedelta(milliseconds=4)
N_ROW = 1000  # four seconds: past midnight, and into the next month
FORMATS = {
    "year first": "%Y-%m-%d %H:%M:%S.%f",
    "ISO 8601": "%Y-%m-%dT%H:%M:%S.%fZ",
    "zone": "%Y-%m-%d %H:%M:%S.%f+02:00",
    "day first": "%d.%m.%Y %H:%M:%S,%f",
    "month first": "%m/%d/%y %H:%M:%S.%f",
    "time of day": "%H:%M:%S.%f",
    "of two halves": "%I:%M:%S.%f %p",
}


def written(form: str) -> list[str]:
    """Return instants of an even clock across midnight."""
    return [(MOMENT + i * STEP).strftime(FORMATS[form]) for i in range(N_ROW)]


@pytest.mark.parametrize("form", FORMATS)
def test_a_clock_runs_on_across_midnight_however_it_is_written(form: str) -> None:
    midnight = MOMENT.replace(hour=0, minute=0, second=0)
    true = [(MOMENT + i * STEP - midnight).total_seconds() for i in range(N_ROW)]
    found = instants(written(form))
    assert found is not None
    np.testing.assert_allclose(found, true, rtol=0, atol=1e-9)  # a day in s has a resolution of 1.5e-11


def test_days_that_lie_apart_are_counted_by_the_calendar() -> None:
    found = instants(["2024-02-28 12:00:00", "2024-03-01 12:00:00.5"])  # a leap year
    assert found is not None
    assert np.diff(found) == 2 * 86_400 + 0.5


def test_an_empty_cell_is_a_hole() -> None:
    found = instants(["10:00:00", "", "10:00:01"])
    assert found is not None
    np.testing.assert_array_equal(found, [36_000, np.nan, 36_001])


@pytest.mark.parametrize(
    "cells",
    [
        ["2024-01-31", "2024-02-01"],  # no time of day
        ["2024-01-31 10:00:00"] * 3,  # when the recording was made
        ["10:00:00", "2024-01-31 10:00:01"],
        ["10:00:00Z", "10:00:01+01:00"],
        ["2024-02-30 10:00:00", "2024-02-30 10:00:01"],
        ["10:00", "10:01"],
        ["", ""],
    ],
)
def test_what_is_no_clock_stays_words(cells: list[str]) -> None:
    assert instants(cells) is None


def test_readers_take_a_clock_of_instants_as_seconds(tmp_path: Path) -> None:
    moments = written("year first")
    table, log = tmp_path / "log.csv", tmp_path / "log.json"
    table.write_text("stamp,q\n" + "".join(f"{moment},{i}\n" for i, moment in enumerate(moments)))
    log.write_text(json.dumps([{"stamp": moment, "q": i} for i, moment in enumerate(moments)]))
    for reader, path in ((CsvRecords, table), (JsonRecords, log)):
        np.testing.assert_allclose(np.diff(reader.read(path)["stamp"]), 0.004, rtol=0, atol=1e-10)
        assert "stamp: dates or times of day, read in seconds since midnight" in reader.describe(path)
