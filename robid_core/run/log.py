"""The log file of a run: appended, with a line between runs; the clock may stand here, never in an artifact."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from pathlib import Path

from robid_core.store import NoFile, failures_named

NAME = "robid"


class _LogFile(logging.FileHandler):
    """A log file whose failure does not end the run: a full disk stops it at its next artifact anyway."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Lose the line."""


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
