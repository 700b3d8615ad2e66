"""The study as one command, from the repository's root: `python -m studies.hidden_effects.run strengths`.

An excitation, or a plant, whose rows stand in the table is not made again; `summary` prints what the tables say.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported

from studies.fit_accuracy.tables import Row, commit, read, write  # noqa: E402
from studies.hidden_effects import pairs, strengths, tracking  # noqa: E402
from studies.hidden_effects.excitations import EXCITATIONS  # noqa: E402


@dataclass(frozen=True)
class Question:
    """A table of its own."""

    column: str
    """What rows are made for, together."""
    choices: Sequence[str]
    """Its values."""
    rows: Callable[[int, Sequence[str]], Iterator[Row]]
    """Makes rows from a seed and some choices, those of a choice together."""
    report: Callable[[Sequence[Row]], list[str]]
    """Lines that sum up the rows."""


QUESTIONS = {
    "strengths": Question(
        "excitation", tuple(EXCITATIONS), partial(strengths.rows, "six_axis"), strengths.report
    ),
    "pairs": Question("excitation", tuple(EXCITATIONS), partial(pairs.rows, "one_axis"), pairs.report),
    "tracking": Question("hidden", tuple(tracking.SECRETS), tracking.rows, tracking.report),
}


def main() -> None:
    """Fill a table, or print what the tables say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("question", choices=(*QUESTIONS, "summary"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent, help="of the tables")
    told = parser.parse_args()
    for name in QUESTIONS if told.question == "summary" else (told.question,):
        question, table = QUESTIONS[name], told.folder / f"{name}.csv"
        rows = read(table)
        if told.question != "summary":
            there = {row[question.column] for row in rows if row["seed"] == str(told.seed)}
            missing, made = [one for one in question.choices if one not in there], {"commit": commit()}
            command = f"python -m studies.hidden_effects.run {name} --seed {told.seed}"
            for chosen, own in groupby(question.rows(told.seed, missing), itemgetter(question.column)):
                rows += [row | made for row in own]
                write(table, rows, command)
                print(chosen, flush=True)
        print("\n".join(question.report(rows)))


if __name__ == "__main__":
    main()
