"""Damages files of one format again and again and judges what is made of them.

    python tests/fuzz/run.py npz 100000                                 # numbers 0 to 99 999
    python tests/fuzz/run.py all 100000 --table tests/fuzz/counts.csv   # goes on from what the table has
    python tests/fuzz/run.py hdf5 1000 --first 20000

Prints the outcomes, and each that is not allowed with the number that makes it again. The table has one line a
format: how many files, from number 0 on, had which outcome. A block of files with one that is not allowed does not
come into it, and the format's next run begins with that block.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.damage import damaged
from fuzz.judgement import GOOD, Judge, Tally
from fuzz.samples import SAMPLES

BLOCK = 1000
MEMORY = "/dev/shm"  # where files cost no disk; the default folder where there is none
COLUMNS = ("format", "files", *GOOD, "slowest_s")
Rows = dict[str, dict[str, float]]


def fuzz(name: str, numbers: Iterable[int], folder: Path) -> Tally:
    """Return what came of damaged files of one format, by the numbers of their damage."""
    suffix, _, write, _ = SAMPLES[name]
    sound = folder / f"sound{suffix}"
    write(sound)
    data, judge = sound.read_bytes(), Judge(name, sound)
    path = folder / f"damaged{suffix}"
    for number in numbers:
        content, words = damaged(data, number)
        path.write_bytes(content)
        judge.judge(path, words)
    return judge.tally


def fuzz_in_memory(name: str, numbers: Iterable[int]) -> Tally:
    """Do the same in a folder that needs no disk."""
    with tempfile.TemporaryDirectory(dir=MEMORY if Path(MEMORY).is_dir() else None) as folder:
        return fuzz(name, numbers, Path(folder))


def read_counts(table: Path) -> Rows:
    """Return the lines of a table by format; none where there is no file."""
    if not table.exists():
        return {}
    lines = table.read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return {row.pop("format"): {name: float(number) for name, number in row.items()} for row in rows}


def write_counts(table: Path, rows: Rows) -> None:
    """Write a table anew, whole or not at all; its lines with # stay."""
    kept = table.read_text(encoding="utf-8").splitlines() if table.exists() else []
    lines = [line for line in kept if line.startswith("#")]
    lines.append(",".join(COLUMNS))
    for name in SAMPLES:
        if name in rows:
            lines.append(",".join([name, *(f"{rows[name][column]:.9g}" for column in COLUMNS[1:])]))
    fresh = table.with_suffix(".part")
    fresh.write_text("\n".join(lines) + "\n", encoding="utf-8")
    fresh.replace(table)


def continue_table(name: str, count: int, table: Path) -> Tally:
    """Fuzz a format from what the table has up to `count` files, block by block; stop at a fault."""
    whole = Tally()
    while True:
        rows = read_counts(table)
        row = rows.setdefault(name, dict.fromkeys(COLUMNS[1:], 0.0))
        first = int(row["files"])
        if first >= count:
            return whole
        tally = fuzz_in_memory(name, range(first, min(first + BLOCK, count)))
        whole.counts = dict(Counter(whole.counts) + Counter(tally.counts))
        whole.slowest_s = max(whole.slowest_s, tally.slowest_s)
        if tally.faults:
            whole.faults = tally.faults
            return whole
        row["files"] += sum(tally.counts.values())
        row["slowest_s"] = round(max(row["slowest_s"], tally.slowest_s), 2)
        for outcome, number in tally.counts.items():
            row[outcome] += number
        write_counts(table, rows)


def main() -> None:
    """Fuzz the formats named, separated by commas."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("formats", help=f"all, or some of {', '.join(SAMPLES)}")
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--table", type=Path, default=None)
    arguments = parser.parse_args()
    n_fault = 0
    for name in arguments.formats.split(",") if arguments.formats != "all" else SAMPLES:
        if arguments.table:
            tally = continue_table(name, arguments.count, arguments.table)
        else:
            tally = fuzz_in_memory(name, range(arguments.first, arguments.first + arguments.count))
        print(f"{name}: slowest {tally.slowest_s:.2f} s: {tally.counts}", flush=True)
        for fault in tally.faults[:40]:
            print(f"  {fault}", flush=True)
        n_fault += len(tally.faults)
    sys.exit(1 if n_fault else 0)


if __name__ == "__main__":
    main()
