"""Diagnoses of blind cases as a table: `python -m blind.score --seeds 1-5` from `tests`; rows that stand are kept.

Seeds below 10^6 are for development; a score to be published is taken once, on seeds that nobody chose.
"""

from __future__ import annotations

import argparse
import csv
import logging
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from blind.cases import FAMILIES, blind_case
from robid_core import Context
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

FIELDS = (
    "kind", "seed", "size", "right", "first", "others", "gain", "misfit", "late", "found_late", "seconds",
)  # fmt: skip


def judged(kind: str, seed: int) -> dict[str, str]:
    """Make one case, diagnose it, and say whether the verdict is right."""
    case = blind_case(seed, kind)
    context = Context(
        np.random.default_rng(seed), map_in_process, lambda *_: None, logging.getLogger("blind")
    )
    began = time.perf_counter()
    diagnosis = Effects().run((case.record,), case.told, context)
    seconds = time.perf_counter() - began
    findings = diagnosis.findings
    named = [finding.effect for finding in findings]
    right = not named if not kind else bool(named) and named[0] in FAMILIES[kind]
    tied = [tie.partition(" at ")[0] for finding in findings[:1] for tie in finding.ties]
    right = right or bool(kind and set(tied) & set(FAMILIES.get(kind, ())))
    lines = diagnosis.verdict.split("\n")
    late = next((line.split(" by ")[1].split(" ")[0] for line in lines if line.startswith("Timing")), "")
    return {
        "kind": kind,
        "seed": str(seed),
        "size": f"{case.size:.4g}",
        "right": str(right),
        "first": named[0] if named else "",
        "others": " ".join(named[1:]),
        "gain": f"{findings[0].gain:.4g}" if findings else "",
        "misfit": next(line for line in lines if line.startswith("Misfit")),
        "late": f"{case.late:.3f}",
        "found_late": late,
        "seconds": f"{seconds:.1f}",
    }


def main() -> None:
    """Fill the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="1-3")
    parser.add_argument("--kinds", default=",".join(["", *FAMILIES]))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", type=Path, default=Path("blind.csv"))
    told = parser.parse_args()
    first, last = (int(part) for part in told.seeds.split("-"))
    rows: list[dict[str, str]] = []
    if told.table.is_file():
        with told.table.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    there = {(row["kind"], row["seed"]) for row in rows}
    wanted = [
        (k, s) for s in range(first, last + 1) for k in told.kinds.split(",") if (k, str(s)) not in there
    ]
    with ProcessPoolExecutor(told.jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for row in pool.map(judged, *zip(*wanted, strict=True)) if wanted else ():
            rows.append(row)
            with told.table.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, FIELDS)
                writer.writeheader()
                writer.writerows(rows)
            print(*(row[name] or "-" for name in FIELDS), flush=True)


if __name__ == "__main__":
    main()
