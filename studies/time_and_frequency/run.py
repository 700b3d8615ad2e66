"""The study as one command, from the repository's root: `python -m studies.time_and_frequency.run --seeds 1-6`.

Rows that stand in the table are not made again; `--summary` prints what it says.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported

from studies.fit_accuracy.tables import fill, read  # noqa: E402
from studies.time_and_frequency.comparison import QUESTION  # noqa: E402


def main() -> None:
    """Fill the table, and print what it says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="1-6", help="first and last")
    parser.add_argument("--only", default="", help="cases, with commas")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--table", type=Path, default=Path(__file__).with_name("comparison.csv"))
    parser.add_argument("--summary", action="store_true")
    told = parser.parse_args()
    if told.summary:
        print("\n".join(QUESTION.report(read(told.table))))
        return
    first, last = (int(part) for part in told.seeds.split("-"))
    only = told.only.split(",") if told.only else []
    command = "python -m studies.time_and_frequency.run"
    rows = fill(QUESTION, told.table, range(first, last + 1), command, told.jobs, only)
    print("\n".join(QUESTION.report(rows)))


if __name__ == "__main__":
    main()
