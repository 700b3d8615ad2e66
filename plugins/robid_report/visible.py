"""What a diagnosis would have seen: the smallest size of each effect, a column for each place."""

from __future__ import annotations

from typing import Any

from robid_core import Diagnosis, VisibleSize
from robid_report.numbers import significant


def visible_table(diagnosis: Diagnosis | None) -> dict[str, Any] | None:
    """Return places and rows (effect, side, parameter, unit, size at each place); None where nothing was searched."""
    search = diagnosis.search if diagnosis is not None else None
    if search is None or not search.visible:
        return None
    places = list(dict.fromkeys(one.on for one in search.visible))
    rows: dict[tuple[str, str, str], dict[str, VisibleSize]] = {}
    for one in search.visible:
        rows.setdefault((one.effect, one.side, one.parameter), {})[one.on] = one
    return {
        "places": places,
        "rows": [
            (*key, _unit(own), [significant(own[place].size, 2) if place in own else "" for place in places])
            for key, own in sorted(rows.items())
        ],
    }


def _unit(own: dict[str, VisibleSize]) -> str:
    unit = next(iter(own.values())).unit_symbol
    return "" if unit == "1" else unit
