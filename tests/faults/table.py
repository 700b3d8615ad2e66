"""Writes `docs/tested_faults.md` from what the tests say: python tests/faults/table.py."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT / "tests"))

from faults.fault import Fault, faults_in  # noqa: E402

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
here, and `pytest -m full tests/faults` breaks every line and runs its test. Exit codes: 2 configuration, 3 refused
before anything moved, 4 motion aborted, 5 data rejected, 6 numerics not trustworthy, 7 store or file, 8 plugin, 130
interrupted.
"""


def table(faults: list[Fault]) -> str:
    """Return the page."""
    parts = [HEAD]
    for letter, title in KINDS.items():
        own = [one for one in faults if one.identifier.startswith(letter)]
        if own:
            rows = "".join(_row(one) for one in own)
            parts.append(
                f"## {title}\n\n| fault | the user sees | test | mutant |\n|---|---|---|---|\n{rows}"
            )
    return "\n".join(parts)


def _row(one: Fault) -> str:
    if one.mutant is None:
        broken = f"none: {one.without}"
    else:
        broken = f"`{one.mutant.file}`: {_code(one.mutant.old)} becomes {_code(one.mutant.new)}"
    return f"| {one.identifier} | {_text(one.sees)} | `{one.test}` | {broken} |\n"


def _text(words: str) -> str:
    return " ".join(words.split()).replace("|", "\\|")


def _code(line: str) -> str:
    return f"`` {_text(line)} ``" if line.strip() else "nothing"


if __name__ == "__main__":
    TABLE.write_text(table(faults_in(ROOT / "tests", ROOT)), encoding="utf-8")
