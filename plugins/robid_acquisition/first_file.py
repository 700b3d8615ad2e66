"""What the first file of recordings has against the settings, before a run: columns, rows and time, cheaply.

A small file is read; of a large one its reader tells names and shapes, where it can. What is left open is told by the
run.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robid_acquisition.before_run import channel_problems, column_problems, period_problems, tried
from robid_acquisition.channel_values import select
from robid_acquisition.data_file import find_file, reader_of, refuse_others
from robid_acquisition.reading import ReadFiles
from robid_core import FloatArray, RobidError, Robot, files_of

Place = tuple[str | int, ...]
Columns = dict[str, FloatArray]
SMALL = (
    4_000_000  # bytes that are read without asking: two seconds of text that is read slowly, mostly a tenth
)


def file_problems(
    settings: ReadFiles,
    period_s: float | str | None,
    lines: Sequence[int] | str,
    robot: Robot,
    data_root: Path,
) -> dict[Place, str]:
    """Messages on settings that the first file does not go with, by their places.

    Nothing where there is no such file, where it is damaged, or where looking at it would take long.
    """
    if not settings.channels or channel_problems(settings.channels, robot.axis_names):
        return {}
    try:
        if settings.sha256:  # of other data nothing is to be told but that
            files = settings.external_files(data_root)
            if sum(one.stat().st_size for file in files for one in files_of(file)) > SMALL:
                return {}
            refuse_others(files, settings.sha256, settings.source_name, settings.origin)
        recordings = settings.recordings(data_root)
        first = recordings[0].file
        own = {name: channel.file or first for name, channel in settings.channels.items()}
        held = {file: _glimpse(settings, data_root, file) for file in dict.fromkeys([first, *own.values()])}
    except (RobidError, OSError):  # told elsewhere, or by the run
        return {}
    arrays = {name: columns for name, file in own.items() if (columns := held[file]) is not None}
    found, n_row = column_problems(settings.channels, arrays, robot.axis_names)
    columns = held[first]
    if columns is not None:
        constants = [one.column for one in settings.scalars.values()]
        for at, names in ((("time_column",), [settings.time_column]), (("scalars",), constants)):
            for name in filter(None, names):
                tried(found, at, select, columns, name)
    if not found and columns is not None and (timing := _timing(settings, columns, n_row, robot)):
        n_sample, step = timing
        for recording in recordings:
            if recording.file != first or found:
                break
            place: Place = () if settings.index else ("starts_s",) if settings.starts_s else ("stop_s",)
            part = tried(found, place, settings.stretch, recording, n_sample, step)
            if part is not None:
                found |= period_problems(period_s, lines, step, part.stop - part.start)
    return found if settings.path else {place: f"{first}: {words}" for place, words in found.items()}


def _glimpse(settings: ReadFiles, data_root: Path, file: str) -> Columns | None:
    """Arrays of a file, or, of a large one, arrays of their shapes that hold NaN; None where that takes long."""
    reader: Any = reader_of(data_root, file, settings.format).quiet()
    full = find_file(data_root, file, settings.origin)
    if sum(one.stat().st_size for one in files_of(full)) <= SMALL:
        columns: Columns = reader.read(full)
        return columns
    if not hasattr(reader, "shapes"):
        return None
    return {name: np.broadcast_to(np.nan, shape) for name, shape in reader.shapes(full).items()} or None


def _timing(settings: ReadFiles, columns: Columns, n_row: int, robot: Robot) -> tuple[int, float] | None:
    """How many samples a file has on its even grid, and their time; None where only reading it tells."""
    if not settings.time_column:
        assert settings.sample_time_s is not None
        return (n_row, settings.sample_time_s) if n_row else None
    try:
        stamps = settings.time_stamps(columns, n_row, robot)
    except RobidError:  # of the clock, not of a setting
        return None
    if stamps is None or stamps.number is None or settings.sample_time_s is not None:
        return None
    return int(stamps.number[-1]) + 1, stamps.sample_time_s
