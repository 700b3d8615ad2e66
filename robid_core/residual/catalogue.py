"""The catalogue of effects as a diagnosis sees it: names, classes, places in a robot."""

from __future__ import annotations

from robid_core.effect import Place
from robid_core.errors import ConfigurationError
from robid_core.registry import EFFECTS, registry
from robid_core.robot import Robot
from robid_core.robot.effects import place_of


def effect_names() -> list[str]:
    """Names of all effects that are installed, strangers' included."""
    return registry().names(EFFECTS)


def place_in(robot: Robot, label: str, on: str | None, side: str) -> Place | None:
    """Return the place of a force or a signal; none where a robot lacks it (a gear that is rigid)."""
    try:
        return place_of(robot, label, on, side)
    except ConfigurationError:
        return None
