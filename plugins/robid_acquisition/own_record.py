"""A record that robid wrote itself, as its reader gives it: it needs no map of channels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robid_core import ConfigurationError, DataRejected, Record, Robot


def read_own_record(reader: Any, full: Path, robot: Robot) -> Record:
    """Take the record that a reader of robid's own recordings makes.

    Raises
    ------
    ConfigurationError
        If the reader knows columns only.
    DataRejected
        If the record is of another robot's axes.
    """
    if not hasattr(reader, "read_record"):
        described = "\n  ".join(reader.describe(full))
        raise ConfigurationError(
            f"{full.name} needs channels: a map from names to columns; it holds\n  {described}"
        )
    record: Record = reader.read_record(full)
    if record.axis_names != robot.axis_names:
        raise DataRejected(
            f"A06: {full.name} was recorded with the axes {', '.join(record.axis_names)}, the robot has "
            f"{', '.join(robot.axis_names)}"
        )
    return record
