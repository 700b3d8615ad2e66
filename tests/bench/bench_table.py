"""How much a bench measures, and the table it makes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Size:
    """How much is measured: a few seconds for a look, minutes for figures to publish."""

    n_round: int
    seconds: float
    """Simulated seconds of one lane in one round."""
    n_line: int
    period_s: float
    n_configuration: int
    """Of the 100 of Paper B."""


LOOK = Size(n_round=3, seconds=1.0, n_line=30, period_s=5.0, n_configuration=2)
FIGURES = Size(n_round=7, seconds=4.0, n_line=80, period_s=10.0, n_configuration=8)


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    measured: str
    target: str
    reached: bool | None = None
    """Whether the target is met; None: nothing was asked."""


def markdown(rows: list[Row]) -> str:
    """Return the table as it stands in the README."""
    lines = ["| what | measured | at least | |", "|---|---|---|---|"]
    words = {True: "reached", False: "missed", None: ""}
    lines += [f"| {row.what} | {row.measured} | {row.target} | {words[row.reached]} |" for row in rows]
    return "\n".join(lines)
