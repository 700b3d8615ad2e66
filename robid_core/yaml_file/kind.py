"""What kinds of files are read here, how messages call them, and how large they may be."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass


@dataclass(frozen=True)
class FileKind:
    """A kind of file: its name in messages, what an empty one should begin with, its limits, the key that tells it
    from other kinds, and what to do with one where another kind is wanted.
    """

    name: str
    begin: str
    maximum_bytes: int
    maximum_aliases: int
    version_key: str
    instead: str

    @property
    def noun(self) -> str:
        """The name with its article: `a pipeline file`."""
        return f"a {self.name}"


PIPELINE_FILE = FileKind(
    "pipeline file", "`robid: 1`, or see `robid init`", 256 * 1024, 64, "robid", "`robid validate` checks it"
)
CHANNEL_MAP = FileKind(
    "channel map",
    "`channels:`, or see `robid records`",
    256 * 1024,
    64,
    "channels",
    "`robid diagnose --channels` takes it",
)
# A robot of a hundred axes with its bodies written out needs a tenth of this.
ROBOT_FILE = FileKind(
    "robot file",
    "`robid_robot: 1` and `name: ...`",
    1024 * 1024,
    100_000,
    "robid_robot",
    "`robid doctor` looks at it, a pipeline names it under `robot:`",
)


def of_another_kind(keys: Collection[str], wanted: FileKind) -> str | None:
    """Return what is wrong with a file whose keys are those of another kind; None where they are not."""
    for other in (PIPELINE_FILE, ROBOT_FILE):
        if other != wanted and other.version_key in keys and wanted.version_key not in keys:
            return f"{other.noun}, where {wanted.noun} is wanted; {other.instead}"
    return None
