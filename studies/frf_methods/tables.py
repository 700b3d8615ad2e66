"""Tables as small CSV files: four digits, and above them the command that makes them again and the commit it ran on."""

from __future__ import annotations

import csv
import subprocess
from collections.abc import Sequence
from pathlib import Path

Row = dict[str, str | float]
HERE = Path(__file__).parent


def commit() -> str:
    """Commit that is checked out, with a plus where files differ from it."""
    said = subprocess.run(
        ["git", "describe", "--always", "--dirty=+"], cwd=HERE, capture_output=True, text=True, check=False
    )
    return said.stdout.strip() or "no commit"


def write_table(name: str, rows: Sequence[Row], command: str) -> Path:
    """Write `name`.csv beside the study."""
    path = HERE / f"{name}.csv"
    keys = list(dict.fromkeys(key for row in rows for key in row))
    state = commit()  # before the file is touched
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {command}; on {state}\n")
        writer = csv.DictWriter(file, keys, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})
    return path


def read_table(name: str) -> list[dict[str, str]]:
    """Rows of `name`.csv as text."""
    with (HERE / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))
