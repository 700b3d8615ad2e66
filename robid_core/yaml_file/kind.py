"""What kinds of files are read here, how messages call them, and how large they may be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FileKind:
    """A kind of file: its name in messages, what an empty one should begin with, and its limits."""

    name: str
    begin: str
    maximum_bytes: int
    maximum_aliases: int

    @property
    def noun(self) -> str:
        """The name with its article: `a pipeline file`."""
        return f"a {self.name}"


PIPELINE_FILE = FileKind("pipeline file", "`robid: 1`, or see `robid init`", 256 * 1024, 64)
CHANNEL_MAP = FileKind("channel map", "`channels:`, or see `robid records`", 256 * 1024, 64)
# A robot of a hundred axes with its bodies written out needs a tenth of this.
ROBOT_FILE = FileKind("robot file", "`robid_robot: 1` and `name: ...`", 1024 * 1024, 100_000)
