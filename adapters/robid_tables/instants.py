"""Instants that a logger writes as dates and times of day, as seconds.

Only differences count in a recording: seconds begin at midnight of the first row. A day ends where its date changes; of
dates that are not written year first the order of day and month is not asked, so that the next one is the next day.
Times of day alone go on after midnight. Zones are left out where all rows have the same.
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import FloatArray

TOLD = "dates or times of day, read in seconds since midnight"
DAY_S = 86_400.0
_INSTANT = re.compile(
    r"(?P<date>(?:[0-9]{4}[-/.][0-9]{1,2}[-/.][0-9]{1,2}|[0-9]{1,2}[-/.][0-9]{1,2}[-/.](?:[0-9]{4}|[0-9]{2})))?"
    r"(?:(?<=[0-9])[T_ ]+)?"
    r"(?P<hour>[0-9]{1,2}):(?P<minute>[0-5][0-9]):(?P<second>[0-5][0-9](?:[.,][0-9]+)?)"
    r"(?P<half> ?[AaPp][Mm])?"
    r"(?P<zone> ?(?:Z|UTC|[+-][0-9]{2}:?[0-9]{2}))?"
)
_YEAR_FIRST = re.compile(r"([0-9]{4})[-/.]([0-9]{1,2})[-/.]([0-9]{1,2})")


def instants(cells: Sequence[str]) -> FloatArray | None:
    """Return the seconds since midnight of the first row that cells mean, (n_row,), NaN where one is empty.

    None where a cell is no instant with a time of day, where they are written differently from row to row, or where
    all are the same instant: a date of the recording is no clock.
    """
    matches = [_INSTANT.fullmatch(cell) if cell else None for cell in cells]
    found = [match for match, cell in zip(matches, cells, strict=True) if cell]
    if not found or any(match is None for match in found):
        return None
    whole = [match for match in found if match is not None]
    if len({(match["date"] is None, match["half"] is None, match["zone"]) for match in whole}) > 1:
        return None
    try:
        seconds = np.array([_second_of_day(match) for match in whole]) + DAY_S * _days(whole)
    except ValueError:  # a 30th of February
        return None
    if np.ptp(seconds) == 0:
        return None
    values = np.full(len(cells), math.nan)
    values[[match is not None for match in matches]] = seconds
    return values


def _second_of_day(match: re.Match[str]) -> float:
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + (12 if match["half"].strip().lower() == "pm" else 0)
    return 3600.0 * hour + 60.0 * int(match["minute"]) + float(match["second"].replace(",", "."))


def _days(matches: Sequence[re.Match[str]]) -> FloatArray:
    """Days since the first row, (n_row,)."""
    days: FloatArray = np.fromiter(_each_day(matches), dtype=np.float64, count=len(matches))
    days -= days[0]
    return days


def _each_day(matches: Sequence[re.Match[str]]) -> Iterator[float]:
    day, known, before = 0.0, matches[0]["date"], 0.0
    for match in matches:
        date = match["date"]
        if date is None:
            now = _second_of_day(match)
            day += now < before - DAY_S / 2
            before = now
        elif date != known or not day:
            written = _YEAR_FIRST.fullmatch(date)
            day = float(datetime.date(*map(int, written.groups())).toordinal()) if written else day + 1
            known = date
        yield day
