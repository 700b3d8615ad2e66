"""What differs between two descriptions, as models tell it: effects by label and numbers by name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robid_core.artifacts import Model
from robid_core.errors import ConfigurationError
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.named_parameters import layout_of, named_parameters, with_parameters, with_values
from robid_core.robot.file.reading import parse_description
from robid_core.robot.file.wording import reason

Effects = Mapping[str, Mapping[str, Any] | None]


@dataclass(frozen=True)
class Changes:
    """What turns one description into another: effects by label, null where one goes, and numbers by name."""

    base: RobotDescription
    effects: Effects
    numbers: Mapping[str, float]


def changes(base: RobotDescription, description: RobotDescription) -> Changes | None:
    """Return what turns `base` into `description`; None where that is more than effects and numbers."""
    effects: dict[str, Mapping[str, Any] | None] = {
        label: None for label in base.effects if label not in description.effects
    }
    effects |= {k: entry.model_dump() for k, entry in description.effects.items() if k not in base.effects}
    try:
        rebuilt = with_effects(base, effects)
    except ConfigurationError:
        return None
    here = {name: row.value for name, row in named_parameters(description).items()}
    there = {name: row.value for name, row in named_parameters(rebuilt).items()}
    if here.keys() != there.keys() or with_values(rebuilt, here) != with_values(description, here):
        return None
    return Changes(base, effects, {name: value for name, value in here.items() if value != there[name]})


def with_effects(description: RobotDescription, effects: Effects) -> RobotDescription:
    """Return a description with effects added, by label, and those taken off that are null.

    Raises ConfigurationError where the robot has no place for one.
    """
    if not effects:
        return description
    whole = description.model_dump()
    acting = {label: entry for label, entry in whole["effects"].items() if label not in effects}
    whole["effects"] = acting | {label: dict(entry) for label, entry in effects.items() if entry is not None}
    try:
        changed = RobotDescription.model_validate(whole)
    except ValidationError as error:
        first: Any = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ConfigurationError(f"{description.name}: {place}: {reason(first)}") from error
    layout_of(changed)  # an effect that is not installed is told now
    return changed


def base_of(model: Model) -> RobotDescription:
    """Return the description of a model's base robot; raises as `described`."""
    return parse_description(model.base_text, Path(f"{model.base} (base of a model)"))


def described(model: Model) -> RobotDescription:
    """Return the description of the robot that a model describes.

    Raises ConfigurationError where this version of robid or its plugins make no robot of it.
    """
    whole = with_effects(base_of(model), json.loads(model.effects))
    return with_parameters(whole, dict(zip(model.names, model.value.tolist(), strict=True)))


def place_of(entry: Mapping[str, Any] | None) -> list[Any]:
    """Return what an effect is and where it acts: its numbers have names of their own."""
    return [(entry or {}).get(key) for key in ("use", "on", "side")]
