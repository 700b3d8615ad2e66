"""What `robid records` makes of a damaged file, and whether that is allowed.

Allowed: the file is read, or refused by an error of ours with exit code 5 or 7 whose message has its name. Where
checksums cover all of it, what is read is what was written, or something is told; MATLAB's packed variables have a
checksum each, and a file that was cut between two of them cannot be told from one that ends there.
"""

from __future__ import annotations

import contextlib
import logging
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from fuzz.samples import SAMPLES

from robid_core import FloatArray, Record
from robid_core.commands.recordings import inspection
from robid_core.commands.recordings.acquisition import stage_lines
from robid_core.commands.recordings.screen import recording_lines
from robid_core.commands.records import recovered
from robid_core.errors import RobidError
from robid_core.foreign import guarded_reader

Columns = dict[str, FloatArray]
ALLOWED = (5, 7)


@dataclass
class Tally:
    """Outcomes by kind, and what is not allowed, with the damage that led to it."""

    counts: dict[str, int] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    slowest_s: float = 0.0


class Listening(logging.Handler):
    """Whether anything was told in the log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.told: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the message."""
        self.told.append(record.getMessage())


def same(one: Columns, other: Columns) -> bool:
    """Tell whether two readings are the same bits, names and shapes."""
    return one.keys() == other.keys() and all(
        one[name].shape == other[name].shape and np.array_equal(one[name], other[name], equal_nan=True)
        for name in one
    )


class KeptReader:
    """A guarded reader that keeps the columns that it gave last: what was read for a person is judged, too."""

    def __init__(self, name: str) -> None:
        self._reader = guarded_reader(name)
        self.columns: Columns = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def read(self, path: Path) -> Columns:
        """Return the columns of a file."""
        self.columns = self._reader.read(path)
        return self.columns


class Judge:
    """Reads damaged files of one format as `robid records` does, and enters what came of them.

    `sound` is the file before the damage.
    """

    def __init__(self, name: str, sound: Path) -> None:
        _, self._form, _, self._checked = SAMPLES[name]
        self.tally = Tally()
        self._name = name
        self._reader = KeptReader(self._form)
        self._truth = self._reader.read(sound)
        self._record: Record | None = None
        if hasattr(self._reader, "read_record"):
            with contextlib.suppress(RobidError):  # no record of ours
                self._record = self._reader.read_record(sound)
        self._listening = Listening()

    def judge(self, path: Path, words: str) -> None:
        """Enter what became of a file; `words` say what was done to it."""
        logger = logging.getLogger("robid")
        self._listening.told.clear()
        logger.addHandler(self._listening)
        began = time.perf_counter()
        try:
            with mock.patch.object(inspection, "guarded_reader", return_value=self._reader):
                outcome = self._read(path)
        except RobidError as error:
            outcome = _refusal(error, path)
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            outcome = (
                f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno}: {str(error)[:80]}"
            )
        finally:
            logger.removeHandler(self._listening)
        self.tally.slowest_s = max(self.tally.slowest_s, time.perf_counter() - began)
        if outcome not in GOOD:
            self.tally.faults.append(f"{self._name}: {words}: {outcome}")
            outcome = outcome.partition(":")[0]
        self.tally.counts[outcome] = self.tally.counts.get(outcome, 0) + 1

    def _read(self, path: Path) -> str:
        one = inspection.inspect(path, self._form)
        recording_lines(one)
        stage_lines([one], path.parent)
        if one.is_record and not self._recovers(path):
            return SILENT
        if any("A0" in line for line in (*one.lines, *self._listening.told)):
            return "told"
        if one.guesses is None:  # a record of ours, or a file that is described and not read
            self._reader.read(path)
        if same(self._reader.columns, self._truth):
            return "read"
        if not self._checked:
            return "other values"
        if self._name in ENDLESS and same(self._reader.columns, self._part_of_truth()):
            return "fewer variables"
        self._reader.read(path)  # as a stage does, with all that the reader logs
        return "told" if any("A0" in line for line in self._listening.told) else SILENT

    def _part_of_truth(self) -> Columns:
        return {name: values for name, values in self._truth.items() if name in self._reader.columns}

    def _recovers(self, path: Path) -> bool:
        """Tell whether `robid records recover` writes samples that were measured, and marks the others."""
        assert self._record is not None
        output = path.with_suffix(".recovered.h5")
        output.unlink(missing_ok=True)
        recovered(path, self._reader, output)
        found, truth = Record.read(output), self._record
        return all(
            np.array_equal(channel.values[found.run.valid], truth.run.values(name)[found.run.valid])
            for name, channel in found.run.channels.items()
        )


def _refusal(error: RobidError, path: Path) -> str:
    words = str(error)
    if error.exit_code not in ALLOWED or path.name not in words:
        return f"refused with exit code {error.exit_code}: {error}"
    if "crashed" in words:
        return "crash caught"
    if "was not finished" in words:
        return "hang caught"
    if "would need more than" in words:
        return "memory caught"
    any_error = isinstance(error.__cause__, RuntimeError) and "cannot be read as" in words
    return "refused (any error)" if any_error else "refused"


SILENT = "silent"  # checksums cover it, it differs, and nothing was told
ENDLESS = ("mat_packed",)  # cut between two variables it looks whole: nothing in the format counts them
GOOD = (
    "read",
    "other values",  # of a format without checksums over all of it: nobody could tell
    "fewer variables",  # each of them as it was
    "told",
    "refused",
    "refused (any error)",
    "crash caught",
    "hang caught",
    "memory caught",
)
