"""What `robid records` makes of a damaged file, and whether that is allowed.

Allowed: the file is read, or refused by an error of ours with exit code 5 or 7 whose message has its name. Where
checksums cover all of it, what is read is what was written, or something is told.
"""

from __future__ import annotations

import logging
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from fuzz.samples import SAMPLES

from robid_core import FloatArray, Record
from robid_core.commands.recordings.acquisition import stage_lines
from robid_core.commands.recordings.inspection import inspect
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


def recovery_is_right(path: Path) -> bool:
    """Tell whether `robid records recover` writes samples that were measured, and marks the others."""
    output = path.with_suffix(".recovered.h5")
    output.unlink(missing_ok=True)
    recovered(path, guarded_reader("mcap"), output)
    found, truth = (
        Record.read(output),
        guarded_reader("mcap").read_record(path.with_name("sound" + path.suffix)),
    )
    return all(
        np.array_equal(channel.values[found.run.valid], truth.run.values(name)[found.run.valid])
        for name, channel in found.run.channels.items()
    )


def judge(path: Path, name: str, truth: Columns, words: str, tally: Tally) -> None:
    """Read a damaged file as `robid records` does, and enter what came of it."""
    _, reader, _, checked = SAMPLES[name]
    listening = Listening()
    logger = logging.getLogger("robid")
    logger.addHandler(listening)
    began = time.perf_counter()
    try:
        one = inspect(path, reader)
        recording_lines(one)
        stage_lines([one], path.parent)
        outcome = "read"
        if checked:
            told = any("A0" in line for line in (*one.lines, *listening.told))
            outcome = "told" if told else "read"
            if one.is_record and not recovery_is_right(path):
                outcome = "silent"
            elif not told and not same(guarded_reader(reader).read(path), truth):
                told = any("A0" in line for line in listening.told)
                outcome = "told" if told else "silent"
    except RobidError as error:
        outcome = "refused"
        if error.exit_code not in ALLOWED or path.name not in str(error):
            outcome = f"refused with exit code {error.exit_code}: {error}"
        elif "crashed" in str(error):
            outcome = "crash caught"
        elif "was not finished" in str(error):
            outcome = "hang caught"
        elif "would need more than" in str(error):
            outcome = "memory caught"
        elif isinstance(error.__cause__, RuntimeError) and "cannot be read as" in str(error):
            outcome = "refused (any error)"
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        outcome = f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno}: {str(error)[:80]}"
    finally:
        logger.removeHandler(listening)
    tally.slowest_s = max(tally.slowest_s, time.perf_counter() - began)
    if outcome == "silent" or outcome not in GOOD:
        tally.faults.append(f"{name}: {words}: {outcome}")
        outcome = outcome.partition(":")[0]
    tally.counts[outcome] = tally.counts.get(outcome, 0) + 1


GOOD = ("read", "told", "refused", "refused (any error)", "crash caught", "hang caught", "memory caught")
