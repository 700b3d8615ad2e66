"""What a run tells while it works; the command line shows it, a notebook may, and nobody has to."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Protocol

LOG = logging.getLogger("robid.display")


class Listener(Protocol):
    """Interface of what is notified of the course of a run."""

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
    """A listener that shows nothing."""

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


class Shielded:
    """A listener whose failures end no run, least of all a motion: they are logged, and the rest goes on."""

    def __init__(self, listener: Listener) -> None:
        self._listener = listener

    def waiting(self, holder: str) -> None:
        """Pass it on."""
        self._tell(lambda: self._listener.waiting(holder))

    def note(self, text: str) -> None:
        """Pass it on."""
        self._tell(lambda: self._listener.note(text))

    def begin(self, stage: str, index: int, total: int, reasons: Sequence[str]) -> None:
        """Pass it on."""
        self._tell(lambda: self._listener.begin(stage, index, total, reasons))

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        """Pass it on."""
        self._tell(lambda: self._listener.progress(stage, done, total, note))

    def end(self, stage: str, outcome: str, seconds: float) -> None:
        """Pass it on."""
        self._tell(lambda: self._listener.end(stage, outcome, seconds))

    @staticmethod
    def _tell(call: Callable[[], None]) -> None:
        try:
            call()
        except Exception:
            LOG.warning("the run could not be shown", exc_info=True)
