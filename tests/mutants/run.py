"""Tries every mutant: which test catches it, by an assertion, an error, the end of its process or the time limit.

    PYTHONPATH=.:plugins:adapters:tests python tests/mutants/run.py --table tests/mutants/fates.csv
    PYTHONPATH=.:plugins:adapters:tests python tests/mutants/run.py gate      # those whose name or test says so

First all their tests must pass on a sound copy of the sources. What stands in the table is not tried again; mutants
that there are no more leave it. Exit code 1 where one survives. `docs/tested_faults.md` shows the table.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from mutants.every import every_mutant
from mutants.mutant import Fate, Mutant, copy_for_many, pytest_in, tried

TABLE = Path(__file__).with_name("fates.csv")


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    key: str
    room: str
    mutant: str
    killed_by: str
    error: str  # which, where it is no assertion
    test: str


def read_fates(table: Path) -> dict[str, Row]:
    """Return the rows of a table by the mutants' keys; none where there is no file."""
    if not table.exists():
        return {}
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return {row["key"]: Row(**row) for row in csv.DictReader(lines)}


def write_fates(table: Path, rows: dict[str, Row]) -> None:
    """Write a table anew, in the order of the mutants, without those that there are no more."""
    kept = table.read_text(encoding="utf-8").splitlines() if table.exists() else []
    with table.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in kept if line.startswith("#"))
        writer = csv.DictWriter(file, [one.name for one in fields(Row)], lineterminator="\n")
        writer.writeheader()
        for mutants in every_mutant().values():
            writer.writerows(asdict(rows[one.key]) for one in mutants if one.key in rows)


def try_all(wanted: dict[str, list[Mutant]], table: Path | None, jobs: int) -> Counter[str]:
    """Try mutants, each job on a copy of its own; return how many had which fate. SystemExit: a test fails without."""
    known = read_fates(table) if table else {}
    todo = [(room, one) for room, mutants in wanted.items() for one in mutants if one.key not in known]
    fates: Counter[str] = Counter()
    local, writing = threading.local(), threading.Lock()
    with tempfile.TemporaryDirectory() as folder:

        def own_copy() -> None:
            local.copy = copy_for_many(Path(tempfile.mkdtemp(dir=folder)))

        def attempt(room: str, one: Mutant) -> None:
            fate, words = tried(one, local.copy)
            with writing:
                fates[fate.value] += 1
                print(f"{fate.value}: {one.name} ({one.test})", words, flush=True)
                if table and fate is not Fate.SURVIVES:
                    name = " ".join(one.name.split())
                    known[one.key] = Row(one.key, room, name, fate.value, words, one.test)
                    write_fates(table, known)

        with ThreadPoolExecutor(jobs, initializer=own_copy) as threads:
            if todo:
                done = threads.submit(
                    lambda: pytest_in(local.copy, *dict.fromkeys(one.test for _, one in todo))
                ).result()
                if done.returncode:
                    sys.exit(f"without a mutant:\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
            list(threads.map(lambda item: attempt(*item), todo))
    if table:
        write_fates(table, known)
    return fates


def main() -> None:
    """Try the mutants whose name or test holds a word, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("words", nargs="*", default=[""])
    parser.add_argument("--table", type=Path, default=None)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    wanted = {
        room: [
            one for one in mutants if any(word in f"{room} {one.name} {one.test}" for word in arguments.words)
        ]
        for room, mutants in every_mutant().items()
    }
    if not any(wanted.values()):
        parser.error(f"no mutant's room, name or test says {' or '.join(arguments.words)}")
    fates = try_all(wanted, arguments.table, arguments.jobs)
    print(", ".join(f"{fate}: {number}" for fate, number in fates.items()) or "all stand in the table")
    sys.exit(1 if fates[Fate.SURVIVES.value] else 0)


if __name__ == "__main__":
    main()
