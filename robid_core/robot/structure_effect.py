"""Effects that change the robot itself."""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING, ClassVar, Literal

from robid_core.arrays import FloatArray
from robid_core.effect import Effect

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot


class StructureEffect(Effect):
    """A change of the robot itself: payload, extra coordinate, foundation."""

    places: ClassVar[tuple[Literal["axis", "body", "base", "gear"], ...]]
    """What it may be put on; the first is the default."""

    @classmethod
    @abc.abstractmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot with the effect in it; new coordinates are called after `label`."""
