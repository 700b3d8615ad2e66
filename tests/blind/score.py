"""Diagnoses of blind cases as a table: `python -m blind.score` from `tests`; rows that stand are kept.

A case that raises is printed and has no row; the others go on. Seeds below 10^6 are for development; a score to be
published is taken once, on seeds from one number that is drawn when a commit is tagged. `--share 0.05` takes a
twentieth of all strata; `--summary` only reads.
"""

from __future__ import annotations

import argparse
import csv
import math
import multiprocessing
import subprocess
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from threadpoolctl import threadpool_limits

from blind.judging import FIELDS, judged
from blind.plan import asked, plan
from blind.table import Row, summary

HERE = Path(__file__).parent


def rows_of(table: Path) -> list[Row]:
    """Rows that stand in a table."""
    if not table.is_file():
        return []
    with table.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def main() -> None:
    """Fill the table and say what it says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="of the cases that a score is made of")
    parser.add_argument("--strata", default=",".join(asked()["counts"]))
    parser.add_argument("--kinds", default="", help="only cases that hide one of these")
    parser.add_argument("--axes", default="1,2,6")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", type=Path, default=HERE / "development.csv")
    parser.add_argument("--summary", action="store_true")
    told = parser.parse_args()
    rows = rows_of(told.table)
    if not told.summary:
        commit = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=HERE, capture_output=True, text=True, check=True
        ).stdout.strip()
        counts = {name: math.ceil(told.share * n) for name, n in asked()["counts"].items()}
        axes, kinds = {int(n) for n in told.axes.split(",")}, set(filter(None, told.kinds.split(",")))
        there = {(row["stratum"], row["seed"]) for row in rows}
        strata = told.strata.split(",")
        wanted = [
            one
            for one in plan(counts, told.first_seed)
            if one.stratum in strata
            and one.n_axis in axes
            and (not kinds or kinds & set(one.kinds))
            and (one.stratum, str(one.seed)) not in there
        ]
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(told.jobs, mp_context=spawn, initializer=_on_one_core) as pool:
            asked_for = {pool.submit(judged, one, commit): one for one in wanted}
            for done in as_completed(asked_for):
                if (error := done.exception()) is not None:
                    one = asked_for[done]
                    print(f"FAILED {one.stratum} {one.seed}: {type(error).__name__}: {error}", flush=True)
                    continue
                rows.append(done.result())
                _write(told.table, rows)
                print(*(rows[-1][name] or "-" for name in FIELDS), flush=True)
    print(summary(rows))


def _on_one_core() -> None:
    """Times are those of one core: in a worker, linear algebra has one thread."""
    threadpool_limits(limits=1)


def _write(table: Path, rows: list[Row]) -> None:
    """Replace the table at once: who is killed meanwhile leaves the one of before."""
    whole = table.with_suffix(".part")
    with whole.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    whole.replace(table)


if __name__ == "__main__":
    main()
