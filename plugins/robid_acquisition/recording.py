"""One experiment in a file: which of the robot's experiments it is, and under what it was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from robid_core import DataRejected

ROLES = ("train", "test")


@dataclass(frozen=True)
class Recording:
    """An experiment in a file, or the part of a file that holds it.

    `file` is relative to the data root; `start_s` and `stop_s` count from the beginning of the file, None: all of it.
    Numbers are those of the file's maker; nothing says that they begin at 0 or have no gaps.
    """

    file: str
    configuration: int = 1
    block: int = 1
    experiment: int = 1
    start_s: float | None = None
    stop_s: float | None = None
    variant: str = ""
    test: bool = False
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name for people: the file without its folder, and the time where it is a part of one."""
        part = f" from {self.start_s:g} s" if self.start_s else ""
        return PurePosixPath(self.file).name + part

    @property
    def block_name(self) -> str:
        """Say which block it belongs to."""
        whose = f"variant {self.variant}, " if self.variant else ""
        return f"{whose}configuration {self.configuration}, block {self.block}"


def is_test(role: str, where: str) -> bool:
    """Read a role; DataRejected where it is neither train nor test."""
    if role not in ROLES:
        raise DataRejected(f"{where}: role '{role}' is none; write train or test")
    return role == "test"
