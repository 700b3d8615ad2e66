"""Effects that settings name: which places each can have in a robot, and which names mean nothing in it."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence

from robid_core import ConfigurationError, PluginError, Robot, StructureEffect
from robid_core.residual import effect_class, effect_names
from robid_diagnosis.candidates import place_at, spots
from robid_diagnosis.structures import structure_places


def wrong_names(
    robot: Robot, only: Sequence[str], exclude: Sequence[str]
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield where a setting names an effect, or a place of it, that there is not, and what is wrong."""
    known = effect_names()
    for setting, names in (("only", only), ("exclude", exclude)):
        for number, one in enumerate(names):
            use, at, on = one.partition("@")
            if use not in known:
                near = difflib.get_close_matches(use, known, n=1)
                hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(known)}"
                yield (setting, number), f"there is no effect '{use}'; {hint}"
            elif at and setting == "exclude":
                yield (setting, number), f"'{one}': an effect is left out everywhere; write '{use}'"
            elif at and (places := _places(robot, use)) is not None and on not in places:
                where = f"of {robot.name} it can be at {', '.join(places)}" if places else "it has no places"
                yield (setting, number), f"'{one}' could be tried nowhere: {where}"


def _places(robot: Robot, use: str) -> tuple[str, ...] | None:
    """Axes, bearings or bodies at which an effect can be tried; None where it cannot be used, which a search says."""
    try:
        effect = effect_class(use)
    except (ConfigurationError, PluginError):
        return None
    if issubclass(effect, StructureEffect):
        return tuple(structure_places(robot, effect))
    return tuple(dict.fromkeys(spot.on for spot in spots(robot, effect) if place_at(robot, spot) is not None))
