"""What `robid run` shows while it works, and its last screen.

On a terminal: one line per stage with bar, count and time left, gone when the run is over. Elsewhere: plain
lines. Both go to stderr; the last screen goes to stdout: at most 25 lines, but that doubts are all told, and whole.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from robid_core.commands.fit_screen import doubt_lines, first_line, fit_line, fit_table
from robid_core.run.progress import Listener, Silence

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from robid_core.artifacts import Fit
    from robid_core.pipeline import Pipeline
    from robid_core.run import RunResult

LAST_SCREEN_LINES = 25
FEWEST_ROWS = 4  # of a table that doubts leave little room
SECONDS_BETWEEN_LINES = 10.0


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
    """Plain lines on stderr."""

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
        if now - self._told >= SECONDS_BETWEEN_LINES:
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
    """A live line per stage, by rich."""

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
def listening(quiet: bool, verbose: bool) -> Iterator[Listener]:
    """Give the listener that suits the terminal and the wishes of the user."""
    if quiet:
        yield Silence()
    elif verbose or not on_terminal():
        with _log_on_stderr() if verbose else contextlib.nullcontext():
            yield Lines()
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
            yield Bars(progress)


def on_terminal() -> bool:
    """Tell whether a person sees what is written to stderr."""
    return sys.stderr.isatty()


@contextlib.contextmanager
def _log_on_stderr() -> Iterator[None]:
    import logging

    handler = logging.StreamHandler()
    handler.setLevel(logging.INFO)
    handler.setFormatter(logging.Formatter("%(name)s: %(message)s"))
    logging.getLogger("robid").addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger("robid").removeHandler(handler)


def last_screen(pipeline: Pipeline, result: RunResult, again: str) -> list[str]:
    """Return the lines that a person reads when the run is over: at most 25, unless there is much to doubt.

    Parameters
    ----------
    pipeline
        What was run.
    result
        What became of it.
    again
        The command that runs it again.
    """
    show = f"robid show {pipeline.path}"
    head = [headline(pipeline, result)]
    head += doubt_lines(result.doubts)
    page, found = last_page(pipeline, result), fits(pipeline, result)
    tail = [f"page       {_near(page)}"] if page is not None else []
    tail += [f"results    {show}", f"run again  {again}"]
    if not found:
        return [*head, "", *tail]
    stage, fit = found[-1]
    if result.folder.robot(stage).is_file():
        tail.insert(-2, f"robot      {_near(result.folder.robot(stage))}")
    table = fit_table(fit, true_parameters(pipeline))
    told = [first_line(f"{name}: {fit_line(one)}") for name, one in found]
    room = LAST_SCREEN_LINES - len(head) - len(tail) - 2 - len(told)  # two empty lines
    room = max(room, FEWEST_ROWS)
    if len(table) > room:
        table = [*table[: room - 1], f"... {len(table) - room + 1} more: {show} {stage}"]
    return [*head, "", *table, *told, "", *tail]


def headline(pipeline: Pipeline, result: RunResult) -> str:
    """Say in one line what was done."""
    counts = {
        word: list(result.outcomes.values()).count(word) for word in ("made", "same", "kept", "refused")
    }
    n = len(result.outcomes)
    if result.idle:
        return f"{pipeline.name}: nothing to do, all {n} stages are up to date"
    parts = [f"{counts['made'] + counts['same']} made", f"{counts['kept']} up to date"]
    parts += [f"{counts['refused']} without a result"] if counts["refused"] else []
    return f"{pipeline.name}: {n} stages, {', '.join(parts)}, {result.seconds:.1f} s"


def last_page(pipeline: Pipeline, result: RunResult) -> Path | None:
    """Return the last page that belongs to this run."""
    from robid_core.artifacts import Report

    for node in reversed(pipeline.stages):
        record = result.manifest.stages.get(node.name)
        current = result.outcomes.get(node.name) in ("made", "same", "kept")
        if issubclass(node.stage.output, Report) and record is not None and record.file and current:
            return result.folder.path / record.file
    return None


def fits(pipeline: Pipeline, result: RunResult) -> list[tuple[str, Fit]]:
    """Return the fits of this run with their stages, in the order of the file; the last is shown in full."""
    from robid_core.artifacts import Fit

    return [
        (node.name, Fit.read(result.folder.path / result.manifest.stages[node.name].file))
        for node in pipeline.stages
        if issubclass(node.stage.output, Fit) and result.outcomes.get(node.name) in ("made", "same", "kept")
    ]


def true_parameters(pipeline: Pipeline) -> dict[str, float]:
    """Return the parameters of the plant by name, where it is simulated."""
    from robid_core.drives import Drives

    drives = pipeline.drives.settings if pipeline.drives else None
    truth = drives.truth(pipeline.robot.load()) if isinstance(drives, Drives) else None
    return truth.as_mapping() if truth else {}


def _near(path: Path) -> str:
    """Return a path as seen from where the user is, where that is shorter."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def _say(text: str) -> None:
    with contextlib.suppress(
        BrokenPipeError
    ):  # nobody reads any more: no reason to stop, least of all a motion
        typer.echo(text, err=True)
