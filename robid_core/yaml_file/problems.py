"""Everything that is wrong with a file, each mistake at its line and column, all told at once."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

from robid_core.errors import ConfigurationError

KeyPath = tuple[str | int, ...]


@dataclass(frozen=True)
class Mark:
    """A place in the file, counted from 1 in characters; or, as `override`, a value given by `--set`."""

    line: int
    column: int
    override: str = ""


@dataclass(frozen=True)
class Problem:
    """One mistake: where it stands, which value it concerns (dotted path), what is wrong and what to do."""

    file: str
    mark: Mark
    path: str
    message: str

    @property
    def line(self) -> int:
        """Line of the mistake, from 1."""
        return self.mark.line

    @property
    def column(self) -> int:
        """Column of the mistake, from 1."""
        return self.mark.column

    def __str__(self) -> str:
        place = self.mark.override and f"--set {self.mark.override}"
        place = place or f"{self.file}:{self.mark.line}:{self.mark.column}"
        return f"{place}: {self.path}: {self.message}" if self.path else f"{place}: {self.message}"


class FileProblems(ConfigurationError):
    """A file that means nothing: every mistake in line order, in `problems` and as one line of text each."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        ordered = sorted(
            dict.fromkeys(problems), key=lambda p: (bool(p.mark.override), p.line, p.column, p.path)
        )
        self.problems = tuple(ordered)
        super().__init__("\n".join(str(problem) for problem in self.problems))


@dataclass
class ProblemList:
    """Collects problems while a file is read, and remembers which values are spoiled already.

    A value is spoiled when it, something inside it, or something around it was found wrong: whatever
    follows from it would be an echo. `repeated` holds the keys that stand twice.
    """

    file: str
    problems: list[Problem] = field(default_factory=list)
    spoiled: set[KeyPath] = field(default_factory=set)
    repeated: set[KeyPath] = field(default_factory=set)

    def add(self, mark: Mark, path: KeyPath, message: str, *, spoils: bool = True) -> None:
        """Report a mistake in the value at `path`; `spoils=False` where it can still be judged."""
        self.problems.append(Problem(self.file, mark, dotted(path), message))
        if spoils:
            self.spoiled.add(path)

    def spoils(self, *path: str | int) -> bool:
        """Tell whether the value, or what is around it, is known to be wrong."""
        return any(path[:length] in self.spoiled for length in range(1, len(path) + 1))

    def raise_if_any(self) -> None:
        """Raise FileProblems where something was found."""
        if self.problems:
            raise FileProblems(self.problems)


def dotted(path: KeyPath) -> str:
    """Return a path as text: `stages.excite.with.band_hz[1]`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")


def nearest(name: str, known: Collection[str]) -> str | None:
    """Return the known name that `name` was probably meant to be."""
    found = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if not found:
        found = [entry for entry in known if entry.casefold() == name.casefold()]
    return found[0] if found else None


def suggestion(name: str, known: Collection[str], otherwise: str) -> str:
    """Return the second half of a message: what was probably meant, or what there is."""
    near = nearest(name, known)
    if near is not None:
        return f"did you mean '{near}'?"
    return f"{otherwise}: {', '.join(known)}" if known else f"{otherwise}: none"
