"""The log file of a run: appended, with a line between runs; the clock may stand here, never in an artifact."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from pathlib import Path

from robid_core.store import NoFile, failures_named

NAME = "robid"
MOST_WARNINGS = 20  # of a stage that are kept
LONGEST_WARNING = 1000  # characters


class _LogFile(logging.FileHandler):
    """A log file whose failure does not end the run: a full disk stops it at its next artifact anyway."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Lose the line."""


class _Warnings(logging.Handler):
    """Keeps the texts of warnings, each once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.told: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one; a line that cannot be made is lost, as the log file loses it."""
        if record.levelno > logging.WARNING:
            return  # an error ends the stage, and is told by that
        with contextlib.suppress(Exception):
            text = " ".join(record.getMessage().split())[:LONGEST_WARNING]
            if text and text not in self.told and len(self.told) < MOST_WARNINGS:
                self.told.append(text)


@contextlib.contextmanager
def warnings_kept() -> Iterator[list[str]]:
    """Give the list of what is warned of under 'robid' meanwhile; it grows while that goes on."""
    handler, logger = _Warnings(), logging.getLogger(NAME)
    logger.addHandler(handler)
    try:
        yield handler.told
    finally:
        logger.removeHandler(handler)


@contextlib.contextmanager
def log_file(path: Path, title: str) -> Iterator[logging.Logger]:
    """Write everything that is logged under 'robid' to a file, too, and give the run's logger."""
    with failures_named("write", path):
        if path.is_fifo() or path.is_dir() or path.is_socket():  # opening a pipe would wait for who reads it
            raise NoFile(path)
        handler = _LogFile(path, encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s"))
    logger = logging.getLogger(NAME)
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        logger.info("%s %s", "=" * 20, title)
        yield logger
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)
        with contextlib.suppress(OSError):  # a full disk, told by what could not be stored
            handler.close()
