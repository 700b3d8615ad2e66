"""The table of what a diagnosis would have seen: a row for each parameter, a column for each place."""

from __future__ import annotations

from robid_core import Diagnosis, SearchRecord, VisibleSize
from robid_report.visible import visible_table


def test_sizes_stand_under_their_places_and_gaps_are_empty() -> None:
    visible = (
        VisibleSize("friction.stribeck", "axis_1", "motor", "breakaway", "N m", 0.0213),
        VisibleSize("drive.torque_constant", "axis_2", "torque", "error", "1", 0.01),
        VisibleSize("friction.stribeck", "axis_2", "motor", "breakaway", "N m", 0.5),
    )
    table = visible_table(Diagnosis("effects", "", search=SearchRecord(3, 2.0, (), (), (), visible)))
    assert table is not None
    assert table["places"] == ["axis_1", "axis_2"]
    assert table["rows"] == [
        ("drive.torque_constant", "torque", "error", "", ["", "0.010"]),
        ("friction.stribeck", "motor", "breakaway", "N m", ["0.021", "0.50"]),
    ]


def test_where_nothing_was_searched_there_is_no_table() -> None:
    assert visible_table(None) is None
    assert visible_table(Diagnosis("closed loop", "")) is None
