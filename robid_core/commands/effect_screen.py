"""What `robid stages` shows of an effect: where it acts, its theory and source, its table, YAML for a robot file."""

from __future__ import annotations

import inspect
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robid_core.effect import Effect

Row = tuple[str, ...]


def kind_line(effect: type[Effect]) -> str:
    """Say in a line what kind of effect it is, where it may sit, and how much its law remembers."""
    from robid_core.effect import ForceEffect, SignalEffect
    from robid_core.robot.structure_effect import StructureEffect

    if issubclass(effect, StructureEffect):
        return f"a change of the robot itself, on: {_places(effect.places)}"
    if not issubclass(effect, ForceEffect | SignalEffect):
        return "an effect of no known kind"
    where = (
        f"a force on side: {_places(effect.sides)}"
        if issubclass(effect, ForceEffect)
        else f"a distortion on side: {_places(effect.channels)}"
    )
    memory = {0: "no state", 1: "1 state"}.get(effect.n_state, f"{effect.n_state} states")
    return f"{where}; its law has {memory}"


def _places(names: tuple[str, ...]) -> str:
    first, *others = names
    return f"{first} (the default)" + "".join(f", {name}" for name in others) if others else first


def theory(effect: type[Effect]) -> list[str]:
    """Return the docstrings of the effect and of its file, and the source, as lines."""
    lines = [inspect.getdoc(effect) or "(no description)"]
    module = inspect.getdoc(sys.modules[effect.__module__])
    if module:
        lines += ["", module]
    return [*lines, "", f"Source: {getattr(effect, 'source', '(none)')}"]


def parameter_rows(effect: type[Effect]) -> list[Row]:
    """Return name, unit, default, bounds and meaning of every parameter."""
    return [
        (row.name, row.unit, f"{row.default:g}", f"{row.lower:g} to {row.upper:g}", row.description)
        for row in effect.parameters
    ]


def paste(name: str, effect: type[Effect]) -> list[str]:
    """Return the part of a robot.yaml that puts the effect at its default place with its defaults."""
    spots: tuple[str, ...] = getattr(effect, "places", ())
    sides: tuple[str, ...] = getattr(effect, "sides", getattr(effect, "channels", ()))
    noun = "axis or joint" if "body" in spots else "axis or bearing" if "bearing" in sides else "axis"
    on = "base" if spots[:1] == ("base",) else f"axis_1  # an {noun} of the robot"
    lines = ["effects:", "  cause:", f"    use: {name}", f"    on: {on}"]
    if sides:
        lines.append(f"    # side: {sides[0]}")
    if effect.parameters:
        lines.append("    # with:")
        lines += [f"    #   {row.name}: {row.default:.12g}  # {row.unit}" for row in effect.parameters]
    return lines
