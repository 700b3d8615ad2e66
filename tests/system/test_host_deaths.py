"""Some of the deaths that `host_deaths.py` makes by the hundred: rest in time, motion once, nothing left."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest
from faults.fault import fault

HERE = Path(__file__).parent


def deaths(number: int, table: Path, *options: str) -> list[dict[str, str]]:
    """Return the rows of deaths that were performed now, all of them good."""
    command = [sys.executable, str(HERE / "host_deaths.py"), "--deaths", str(number), "--table", str(table)]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    with table.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.system
@fault(
    "D09",
    sees="after kill -9 of a run: the drives rest by themselves; the next run: the motion was begun, not finished",
    mutant=(
        "adapters/robid_can/host/bring_up.py",
        "        od.CONSUMER_HEARTBEAT: watch.HOST_NODE_ID << 16 | round(watch.SILENCE_S * 1e3),\n",
        "",
    ),
)
def test_D09_drives_of_a_host_that_dies_rest_within_their_watchdog_and_move_once(tmp_path: Path) -> None:
    rows = deaths(20, tmp_path / "deaths.csv", "--seed", "10", "--jobs", "4", "--chunk", "5")
    assert {row["kind"] for row in rows} == {"kill", "stop", "continue"}
    assert {row["trigger"] for row in rows} == {"frame", "clock", "motion"}
    assert (
        sum(float(row["speed"]) > 1.0 for row in rows) >= 3
    )  # rad/s: motors that turned when the watchdog fired
    assert {row["motions"] for row in rows} == {"0", "1"}


@pytest.mark.full
def test_D09_a_thousand_hosts_die(tmp_path: Path) -> None:
    assert len(deaths(1000, tmp_path / "deaths.csv", "--seed", "11")) == 1000


def test_the_table_of_deaths_is_all_good() -> None:
    with (HERE / "host_deaths.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) >= 200
    assert {row["good"] for row in rows} == {"True"}
    assert max(int(row["motions"]) for row in rows) == 1
    assert max(float(row["rest_ms"]) for row in rows if row["rest_ms"] != "nan") <= 2.0
