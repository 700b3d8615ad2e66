"""Writes `docs/tested_faults.md` from what the tests say: python tests/faults/table.py."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT / "tests"))

from faults.fault import Fault, faults_in  # noqa: E402
from mutants.every import NAMED, every_mutant  # noqa: E402
from mutants.mutant import Fate, Mutant  # noqa: E402
from mutants.run import TABLE as FATES, Row, read_fates  # noqa: E402

TABLE = ROOT / "docs" / "tested_faults.md"
KINDS = {
    "B": "Bus",
    "D": "Drives and motion",
    "A": "Acquisition and data",
    "N": "Numerics",
    "R": "Run, store and plugins",
    "Y": "YAML, report and paths",
}
HEAD = """# Tested faults

What may go wrong, what the user sees, the test that tries it, and the mutant: the line that the test does not let be
broken. Made from the tests by `python tests/faults/table.py`; `tests/faults/fault.py` says how a test enters itself
here. Exit codes: 2 configuration, 3 refused before anything moved, 4 motion aborted, 5 data rejected, 6 numerics not
trustworthy, 7 store or file, 8 plugin, 130 interrupted.

`PYTHONPATH=.:plugins:adapters:tests python tests/mutants/run.py --table tests/mutants/fates.csv` breaks every line of
this page, one at a time, in a copy of the sources that passes all these tests, and runs the test: {}. An error is
one that the broken line raised in the test, which did not come to its assertion.
"""
NOT_TRIED = "not tried yet"


def table(faults: list[Fault], fates: dict[str, Row]) -> str:
    """Return the page."""
    parts = [HEAD.format(_summary(fates))]
    for letter, title in KINDS.items():
        own = [one for one in faults if one.identifier.startswith(letter)]
        if own:
            rows = "".join(_row(one, fates) for one in own)
            parts.append(
                f"## {title}\n\n| fault | the user sees | test | mutant | killed by |\n|---|---|---|---|---|\n{rows}"
            )
    for room, mutants in NAMED.items():
        rows = "".join(
            f"| {_text(one.name)} | `{one.test}` | {_broken(one)} | {_killed_by(one, fates)} |\n"
            for one in mutants
        )
        parts.append(
            f"## Mutants of the {room}\n\n| mutant | test | broken line | killed by |\n|---|---|---|---|\n{rows}"
        )
    return "\n".join(parts)


def _summary(fates: dict[str, Row]) -> str:
    everyone = [one for mutants in every_mutant().values() for one in mutants]
    found = Counter(fates[one.key].killed_by if one.key in fates else NOT_TRIED for one in everyone)
    kinds = [fate.value for fate in Fate] + [NOT_TRIED]
    return f"of {len(everyone)} mutants " + ", ".join(
        f"{found[kind]} {'are' if kind == NOT_TRIED else 'fall by'} {kind}" for kind in kinds if found[kind]
    )


def _row(one: Fault, fates: dict[str, Row]) -> str:
    broken = f"none: {one.without}" if one.mutant is None else _broken(one.mutant)
    killed = "" if one.mutant is None else _killed_by(one.mutant, fates)
    return f"| {one.identifier} | {_text(one.sees)} | `{one.test}` | {broken} | {killed} |\n"


def _broken(mutant: Mutant) -> str:
    return f"`{mutant.file}`: {_code(mutant.old)} becomes {_code(mutant.new)}"


def _killed_by(mutant: Mutant, fates: dict[str, Row]) -> str:
    row = fates.get(mutant.key)
    return NOT_TRIED if row is None else f"{row.killed_by} {row.error}".strip()


def _text(words: str) -> str:
    return " ".join(words.split()).replace("|", "\\|")


def _code(line: str) -> str:
    return f"`` {_text(line)} ``" if line.strip() else "nothing"


if __name__ == "__main__":
    TABLE.write_text(table(faults_in(ROOT / "tests", ROOT), read_fates(FATES)), encoding="utf-8")
