"""A sentence about a number of a robot file that is hard to believe, with its place."""

from __future__ import annotations

import re
from dataclasses import dataclass

from robid_core.yaml_file.problems import KeyPath


@dataclass(frozen=True)
class Remark:
    """An implausible number of a robot."""

    where: str
    """Key of the robot file, dotted."""
    what: str
    """What is there, how large, and what to do."""
    impossible: bool = False
    """Whether no robot can be so."""
    path: KeyPath = ()
    """The key as a path, where the dotted one does not tell it: patterns have dots of their own."""

    @property
    def sentence(self) -> str:
        """The place once, and what is there."""
        return self.what if self.what.startswith(self.where) else f"{self.where}: {self.what}"

    @property
    def key(self) -> KeyPath:
        """The key as a path: `bodies[0] (axis_1).inertia` is bodies, 0, inertia."""
        if self.path:
            return self.path
        parts = re.findall(r"\[(\d+)\]|([^.\[\]]+)", re.sub(r" \([^)]*\)", "", self.where))
        return tuple(int(number) if number else name for number, name in parts)
