"""A robot file as it is judged: its data, where in the file each value stands, and what was found wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from robid_core.robot.part import Path
from robid_core.robot.problems import Mark, Problem, RobotProblems


@dataclass
class Document:
    """A file read: its data, the place of everything in it, and the mistakes found so far."""

    file: str
    data: dict[str, Any] = field(default_factory=dict)
    marks: dict[Path, Mark] = field(default_factory=dict)
    """Places of values by their path: of the key in a mapping, of the item in a list."""
    problems: list[Problem] = field(default_factory=list)
    names: dict[Path, str] = field(default_factory=dict)
    """What entries of lists are called: said before what is wrong with them."""
    spoiled: set[Path] = field(default_factory=set)
    """Entries that are known to be wrong: what follows from them would be an echo."""

    def mark(self, path: Path) -> Mark:
        """Return the place of a value, or of what holds it where it is not in the file itself."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.marks:
                return self.marks[path[:length]]
        return Mark(1, 1)

    def derive(self, path: Path, origin: Path) -> None:
        """Let `path`, which is not in the file, stand where `origin` stands: it was made from that."""
        self.marks.setdefault(path, self.mark(origin))

    def add(self, path: Path, message: str, mark: Mark | None = None) -> None:
        """Report a mistake in the entry at a path, unless that is spoiled already."""
        if any(path[:length] in self.spoiled for length in range(1, len(path) + 1)):
            return
        called = next((name for start, name in self.names.items() if path[: len(start)] == start), "")
        if called and not message.startswith(called):
            message = f"{called}: {message}"
        self.problems.append(Problem(self.file, mark or self.mark(path), path, message))

    def raise_if_any(self) -> None:
        """Raise RobotProblems with every mistake, in the order of lines."""
        if self.problems:
            raise RobotProblems(self.problems)
