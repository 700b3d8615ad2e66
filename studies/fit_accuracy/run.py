"""The study as one command, from the repository's root: `python -m studies.fit_accuracy.run QUESTION --seeds 1-20`.

QUESTION names a table; rows that stand in it are not made again. `summary` prints what all tables say.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: rows are dealt to processes here

from studies.fit_accuracy import accuracy, alarm, bound_check, wear  # noqa: E402
from studies.fit_accuracy.tables import fill, read  # noqa: E402

QUESTIONS = {
    "own": accuracy.question("own"),
    "foreign": accuracy.question("foreign"),
    "bound_check": bound_check.QUESTION,
    "wear": wear.QUESTION,
    "alarm": alarm.QUESTION,
}


def main() -> None:
    """Fill a table, or print what the tables say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("question", choices=(*QUESTIONS, "summary"))
    parser.add_argument("--seeds", default="1-20", help="first and last; draws of bound_check")
    parser.add_argument("--only", default="", help="values of the table's first choice, such as scenarios")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent, help="of the tables")
    told = parser.parse_args()
    paths = {name: told.folder / f"{name}.csv" for name in QUESTIONS}
    if told.question == "summary":
        for name, question in QUESTIONS.items():
            if rows := read(paths[name]):
                print("\n".join(question.report(rows)))
        return
    told.folder.mkdir(parents=True, exist_ok=True)
    first, last = (int(part) for part in told.seeds.split("-"))
    question, command = QUESTIONS[told.question], f"python -m studies.fit_accuracy.run {told.question}"
    only = told.only.split(",") if told.only else []
    rows = fill(question, paths[told.question], range(first, last + 1), command, told.jobs, only)
    if rows:
        print("\n".join(question.report(rows)))


if __name__ == "__main__":
    main()
