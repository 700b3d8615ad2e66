"""Everything that is wrong with a robot file, each at its line and column, all told at once."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from robid_core.errors import ConfigurationError
from robid_core.robot.part import Path


@dataclass(frozen=True, order=True)
class Mark:
    """A place in the file, counted from 1 in characters."""

    line: int
    column: int


@dataclass(frozen=True)
class Problem:
    """One mistake: where it stands, which entry it concerns, what is wrong and what to do."""

    file: str
    mark: Mark
    path: Path
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.mark.line}:{self.mark.column}"
        return f"{place}: {dotted(self.path)}: {self.message}" if self.path else f"{place}: {self.message}"


class RobotProblems(ConfigurationError):
    """A robot file that describes no robot: every mistake in line order, in `problems` and as one line each."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        ordered = sorted(dict.fromkeys(problems), key=lambda problem: (problem.mark, dotted(problem.path)))
        self.problems = tuple(ordered)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def dotted(path: Path) -> str:
    """Return a path as text: `bodies[1].axis[2]`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")


def suggestion(name: str, known: Collection[str], otherwise: str) -> str:
    """Return the second half of a message: the known name that was probably meant, or all there are."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"{otherwise}: {', '.join(known) or 'none'}"
