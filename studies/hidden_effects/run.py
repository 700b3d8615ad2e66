"""The study as one command, from the repository's root: `python -m studies.hidden_effects.run strengths`.

An excitation whose rows stand in the table is not made again; `summary` prints what the tables say.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported

from studies.fit_accuracy.tables import Row, commit, read, write  # noqa: E402
from studies.hidden_effects import pairs, strengths  # noqa: E402
from studies.hidden_effects.excitations import EXCITATIONS  # noqa: E402

Rows = Callable[[str, int, Sequence[str]], Iterator[Row]]
QUESTIONS: dict[str, tuple[str, Rows, Callable[[Sequence[Row]], list[str]]]] = {
    "strengths": ("six_axis", strengths.rows, strengths.report),
    "pairs": ("one_axis", pairs.rows, pairs.report),
}
"""The robot that is asked, what makes rows, and what sums them up."""


def main() -> None:
    """Fill a table, or print what the tables say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("question", choices=(*QUESTIONS, "summary"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent, help="of the tables")
    told = parser.parse_args()
    for question in QUESTIONS if told.question == "summary" else (told.question,):
        robot, make, report = QUESTIONS[question]
        table = told.folder / f"{question}.csv"
        rows = read(table)
        if told.question != "summary":
            there = {row["excitation"] for row in rows if row["seed"] == str(told.seed)}
            missing, made = [name for name in EXCITATIONS if name not in there], {"commit": commit()}
            command = f"python -m studies.hidden_effects.run {question} --seed {told.seed}"
            for excitation, own in groupby(make(robot, told.seed, missing), lambda row: row["excitation"]):
                rows += [row | made for row in own]
                write(table, rows, command)
                print(excitation, flush=True)
        print("\n".join(report(rows)))


if __name__ == "__main__":
    main()
