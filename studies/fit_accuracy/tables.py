"""Tables that are filled row by row: what stands there is not made again, and each row tells the product's commit."""

from __future__ import annotations

import csv
import multiprocessing
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import product
from pathlib import Path

Row = dict[str, str]
Key = tuple[tuple[str, ...], int]


@dataclass(frozen=True)
class Question:
    """A table, how its rows are made, and what they say.

    A row is named by `choices` and a number, in columns of these names; the number is what `--seeds` chooses.
    """

    choices: Mapping[str, Sequence[str]]
    """Values that a column may have, by its name, in the order of the table."""
    number: str
    """Name of the column with the number."""
    row: Callable[..., Row]
    """Makes a row from its choices and its number; a function of a module, since other processes call it."""
    report: Callable[[list[Row]], list[str]]
    """Lines that sum up the rows."""

    def key(self, row: Row) -> Key:
        """What names a row."""
        return tuple(row[name] for name in self.choices), int(row[self.number])

    def place(self, row: Row) -> tuple[int, ...]:
        """Where a row stands in the table."""
        chosen, number = self.key(row)
        places = (values.index(one) for values, one in zip(self.choices.values(), chosen, strict=True))
        return *places, number


def read(path: Path) -> list[Row]:
    """Rows of a table; none where there is no file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def write(path: Path, rows: list[Row], command: str) -> None:
    """Write a table with the command that fills it; a row without some column leaves it empty."""
    columns = dict.fromkeys(name for row in rows for name in row)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {command}\n")
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)


def fill(
    question: Question,
    path: Path,
    seeds: Sequence[int],
    command: str,
    jobs: int = 1,
    only: Sequence[str] = (),
) -> list[Row]:
    """Make the rows that are not there, `jobs` at a time, and write the table after each.

    Parameters
    ----------
    question
        Whose table.
    path
        The table's file.
    seeds
        Numbers of the rows.
    command
        First line of the file.
    jobs
        Processes.
    only
        Values of the first choice; empty: all.
    """
    rows = read(path)
    there = {question.key(row) for row in rows}
    missing = [
        (chosen, seed)
        for seed in seeds
        for chosen in product(*question.choices.values())
        if (chosen, seed) not in there and (not only or chosen[0] in only)
    ]
    made_by = {"commit": commit()}
    workers = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=workers) as pool:
        futures = {pool.submit(question.row, *chosen, seed): (chosen, seed) for chosen, seed in missing}
        for done, future in enumerate(as_completed(futures)):
            chosen, seed = futures[future]
            named = dict(zip(question.choices, chosen, strict=True)) | {question.number: str(seed)}
            try:
                made = future.result()
            except Exception as error:
                pool.shutdown(cancel_futures=True)
                error.add_note(f"in row {' '.join((*chosen, str(seed)))}; rows before it are kept")
                raise
            rows = sorted([*rows, named | made_by | made], key=question.place)
            write(path, rows, command)
            what = " ".join((*chosen, str(seed)))
            print(f"\r{done + 1} of {len(missing)}: {what}   ", end="", file=sys.stderr, flush=True)
    return rows


def commit() -> str:
    """Last commit that changed the product, with a plus where its files are changed since."""
    product = ("robid_core", "plugins")
    last = _git("log", "-1", "--format=%h", "--", *product)
    return last + ("+" if _git("status", "--porcelain", "--", *product) else "")


def _git(*arguments: str) -> str:
    done = subprocess.run(
        ["git", *arguments], cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()
