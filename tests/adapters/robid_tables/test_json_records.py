"""JSON logs become columns and constants; nothing is filled in silently."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import DataRejected
from robid_tables.json import JsonRecords


def written(folder: Path, content: Any) -> Path:
    path = folder / "log.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


ENTRIES = [{"timestamp": 0.1 * i, "position": i, "motor": {"temp": 20 + i}, "on": i > 1} for i in range(4)]


def test_a_log_gives_columns_and_the_numbers_beside_it_are_constants(tmp_path: Path) -> None:
    path = written(tmp_path, {"mass": 0.49, "motor": "xl330", "entries": ENTRIES})
    columns = JsonRecords.read(path)
    assert {name: values.shape for name, values in columns.items()} == {
        "mass": (),
        "timestamp": (4,),
        "position": (4,),
        "motor.temp": (4,),
        "on": (4,),
    }
    assert columns["mass"] == 0.49
    assert columns["on"].tolist() == [0.0, 0.0, 1.0, 1.0]
    lines = JsonRecords.describe(path)
    assert "mass: 0.49, a constant" in lines
    assert "motor: text 'xl330', left out" in lines


def test_a_list_of_records_and_lists_by_name_are_the_same_table(tmp_path: Path) -> None:
    one = JsonRecords.read(written(tmp_path, ENTRIES))
    lists = {"timestamp": [e["timestamp"] for e in ENTRIES], "position": [0, 1, 2, 3]}
    other = JsonRecords.read(written(tmp_path, lists))
    for name, values in other.items():
        np.testing.assert_array_equal(one[name], values)


def test_lists_within_records_are_a_table(tmp_path: Path) -> None:
    entries = [{"q": [i, 2 * i, 3 * i]} for i in range(5)]
    columns = JsonRecords.read(written(tmp_path, entries))
    assert columns["q"].shape == (5, 3)
    np.testing.assert_array_equal(columns["q"][4], [4.0, 8.0, 12.0])


def test_two_logs_in_one_file_keep_their_names(tmp_path: Path) -> None:
    columns = JsonRecords.read(written(tmp_path, {"arm": [{"q": 1}, {"q": 2}], "base": [{"q": 3}, {"q": 4}]}))
    assert columns["arm.q"].tolist() == [1.0, 2.0]
    assert columns["base.q"].tolist() == [3.0, 4.0]


def test_what_an_entry_lacks_is_not_a_number_and_told(tmp_path: Path) -> None:
    path = written(tmp_path, [{"q": 1.0, "tau": None}, {"q": 2.0, "tau": 3.0}, {"tau": 4.0}])
    columns = JsonRecords.read(path)
    np.testing.assert_array_equal(columns["q"], [1.0, 2.0, np.nan])
    np.testing.assert_array_equal(columns["tau"], [np.nan, 3.0, 4.0])
    assert "q: absent in 1 of 3 entries, NaN there" in JsonRecords.describe(path)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ('[{"q": "1.5"}, {"q": "2.5"}]', "'q' holds the text '1.5'; write numbers without quotes"),
        ('[{"q": "1,5"}]', "'q' holds the text '1,5'"),
        ('[{"q": 1, "q": 2}]', "'q' stands twice"),
        ('[{"q": 1}, {"q": 2', "A01: the file looks cut"),
        ('[{"q": 1}, {"q', "A01: the file looks cut"),
        ('{"q": [1, 2,, 3]}', ":1: no JSON"),
        ("3", "a single value"),
        ('{"name": "arm"}', "holds no numbers"),
        ("[" * 100_000, "too deep"),
    ],
)
def test_a_wrong_log_is_told(tmp_path: Path, content: str, told: str) -> None:
    with pytest.raises(DataRejected) as caught:
        JsonRecords.read(written(tmp_path, content))
    assert told in str(caught.value)
    assert "log.json" in str(caught.value)


def test_every_cut_of_a_log_is_refused(tmp_path: Path) -> None:
    text = json.dumps({"mass": 0.49, "entries": ENTRIES})
    for length in range(len(text)):
        with pytest.raises(DataRejected):
            JsonRecords.read(written(tmp_path, text[:length]))
