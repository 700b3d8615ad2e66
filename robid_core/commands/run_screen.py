"""What `robid run` shows while it works.

On a terminal: one line per stage with bar, count and time left, gone when the run is over. Elsewhere: plain
lines. Both go to stderr.
"""

from __future__ import annotations

import contextlib
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import typer

from robid_core.run.progress import Listener, Silence
from robid_core.stage import MILESTONE

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

SECONDS_BETWEEN_LINES = 10.0
ALIKE = 40  # letters with which warnings of one kind begin


class Part:
    """What a stage has done of its present part, of which alone the time left can be told.

    A part begins where a stage does, and where it has less done, or another total, than before: fits within a search.
    """

    def __init__(self, now: float) -> None:
        self._began = now, 0.0
        self._latest = 0.0, 0.0

    def seconds_left(self, now: float, done: float, total: float) -> float | None:
        """Take note of what is done; the time that the rest of the part takes, None where nothing tells it."""
        before, whole = self._latest
        if done < before or (total != whole and whole):
            self._began = now, done
        self._latest = done, total
        since, first = self._began
        return (now - since) * (total - done) / (done - first) if done > first else None


class Lines(Silence):
    """Progress of a run as plain lines on stderr."""

    def __init__(self) -> None:
        self._told, self._part = 0.0, Part(0.0)

    def waiting(self, holder: str) -> None:
        """Say for whom the run waits."""
        _say(f"waiting: {holder}")

    def note(self, text: str) -> None:
        """Say it."""
        _say(text)

    def begin(self, stage: str, index: int, total: int, reasons: Sequence[str]) -> None:
        """Say which stage starts, and why."""
        self._told = time.monotonic()
        self._part = Part(self._told)
        _say(f"[{index}/{total}] {stage}: {'; '.join(reasons)}")

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        """Say how far it is, not too often."""
        now = time.monotonic()
        left = self._part.seconds_left(now, done, total)
        ended = done >= total and not note
        if now - self._told >= SECONDS_BETWEEN_LINES and not ended:
            self._told = now
            rest = "" if left is None else f", {left:.0f} s left"
            _say(f"{stage}: {note + ' ' if note else ''}{done:g}/{total:g}{rest}")

    def end(self, stage: str, outcome: str, seconds: float) -> None:
        """Say what became of it."""
        taken = f" in {seconds:.1f} s" if outcome in ("made", "same") else ""
        _say(f"{stage}: {OUTCOMES[outcome]}{taken}")


OUTCOMES = {
    "made": "made",
    "same": "made again, the same as before",
    "kept": "up to date",
    "refused": "gave no result",
}


class Bars(Silence):
    """Progress of a run as one live line per stage, by rich."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._tasks: dict[str, TaskID] = {}

    def waiting(self, holder: str) -> None:
        """Say for whom the run waits."""
        self._progress.console.print(f"waiting: {holder}", markup=False)

    def note(self, text: str) -> None:
        """Say it above the bars."""
        self._progress.console.print(text, markup=False)

    def begin(self, stage: str, index: int, total: int, reasons: Sequence[str]) -> None:
        """Add a line."""
        self._tasks[stage] = self._progress.add_task(f"[{index}/{total}] {stage}", total=None, note="")

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        """Move the bar."""
        if stage in self._tasks:
            task = self._tasks[stage]
            known = self._progress.tasks[task]
            if (
                done < known.completed or total != known.total
            ):  # another part: what the last took tells nothing of it
                self._progress.reset(task, total=total, completed=int(done), note=note)
            self._progress.update(task, completed=done, total=total, note=note)

    def end(self, stage: str, outcome: str, seconds: float) -> None:
        """Close the line."""
        if stage in self._tasks:
            self._progress.update(self._tasks[stage], completed=1, total=1, note=OUTCOMES[outcome])


@contextlib.contextmanager
def listening(quiet: bool, verbose: bool, *, warnings: bool = True) -> Iterator[Listener]:
    """Give the listener that suits the terminal and the wishes of the user; `warnings`: shown as they arise."""
    if quiet:
        yield Silence()
    elif verbose or not on_terminal():
        lines = Lines()
        with _log_on_stderr() if verbose else _milestones(lines, warnings):
            yield lines
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(elapsed_when_finished=True),
            TextColumn("{task.fields[note]}", markup=False),
        )
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            bars = Bars(progress)
            with _milestones(bars, warnings):
                yield bars


def on_terminal() -> bool:
    """Tell whether a person sees what is written to stderr."""
    return sys.stderr.isatty()


class _Milestones(logging.Handler):
    """Shows what stages log as milestones, and warnings as they come: who sees them may stop, and mend a file.

    Of warnings that begin alike, of many recordings for instance, the first; all stand at the end of a run.
    """

    def __init__(self, listener: Listener, warnings: bool) -> None:
        super().__init__(MILESTONE)
        self._listener, self._warnings = listener, warnings
        self._shown = set[str]()

    def emit(self, record: logging.LogRecord) -> None:
        """Show one; a line that cannot be made is lost."""
        warning = record.levelno == logging.WARNING
        if not (record.levelno == MILESTONE or (warning and self._warnings)):
            return
        with contextlib.suppress(Exception):
            text = record.getMessage()
            if warning and text[:ALIKE] in self._shown:
                return
            self._shown.add(text[:ALIKE])
            self._listener.note(f"{'! ' if warning else ''}{record.name.rpartition('.')[2]}: {text}")


def _milestones(listener: Listener, warnings: bool) -> contextlib.AbstractContextManager[None]:
    return _heard_by(_Milestones(listener, warnings))


def _log_on_stderr() -> contextlib.AbstractContextManager[None]:
    handler = logging.StreamHandler()
    handler.setLevel(logging.INFO)
    handler.setFormatter(logging.Formatter("%(name)s: %(message)s"))
    return _heard_by(handler)


@contextlib.contextmanager
def _heard_by(handler: logging.Handler) -> Iterator[None]:
    """Let a handler hear what runs log."""
    logging.getLogger("robid").addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger("robid").removeHandler(handler)


def _say(text: str) -> None:
    typer.echo(text, err=True)
