"""A few of the stops that `stops.py` makes by the hundred: all drives told at once, no hang, the right exit code."""

from __future__ import annotations

import importlib.util
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

HERE = Path(__file__).parent
spec = importlib.util.spec_from_file_location("robid_stops", HERE / "stops.py")
assert spec is not None
assert spec.loader is not None
stops = sys.modules["robid_stops"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(stops)


@pytest.mark.system
def test_stops_with_disobeying_axes_and_repeated_signals_end_as_documented(tmp_path: Path) -> None:
    site = stops.install(tmp_path)
    project = stops.prepare(tmp_path, site)
    cases = [stops.draw(stop, seed=10) for stop in range(4)]
    assert {case.clock for case in cases} == {"simulated", "wall"}
    assert {len(case.numbers) for case in cases} >= {1, 3}
    with ThreadPoolExecutor(2) as threads:
        outcomes = list(threads.map(lambda case: stops.perform(case, project, site), cases))
    assert [(outcome.stop, outcome.why) for outcome in outcomes if not outcome.good] == []
    assert "not stopped" in {outcome.drives for outcome in outcomes}


def test_the_table_of_two_hundred_stops_is_all_good() -> None:
    rows = stops.read_table(HERE / "stops.csv")
    assert [int(row["stop"]) for row in rows] == list(range(200))
    assert {row["good"] for row in rows} == {"True"}
    told = [float(row["told_ms"]) for row in rows if row["drives"] != "not up"]
    assert len(told) > 100
    assert max(told) < stops.CYCLE_MS
