"""What a run tells while it works; the command line shows it, a notebook may, and nobody has to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Listener(Protocol):
    """Hears what a run does."""

    def waiting(self, holder: str) -> None:
        """Another run holds the folder; this one waits."""

    def note(self, text: str) -> None:
        """Something a person should know, such as a damaged artifact that was set aside."""

    def begin(self, stage: str, index: int, total: int, reasons: Sequence[str]) -> None:
        """A stage starts, for these reasons; it is number `index` (from 1) of `total`."""

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        """A stage has done so much."""

    def end(self, stage: str, outcome: str, seconds: float) -> None:
        """A stage is over: made, same, kept or refused."""


class Silence:
    """A listener that does not care."""

    def waiting(self, holder: str) -> None:
        """Say nothing."""

    def note(self, text: str) -> None:
        """Say nothing."""

    def begin(self, stage: str, index: int, total: int, reasons: Sequence[str]) -> None:
        """Say nothing."""

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        """Say nothing."""

    def end(self, stage: str, outcome: str, seconds: float) -> None:
        """Say nothing."""
