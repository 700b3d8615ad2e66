"""What can be estimated or set in a robot by name: `gear_stiffness.axis_2`, `effect.grease.breakaway`.

A name leads to a number of the description, its unit, kind and group (see `parameter_places`). Parameters of effects
come from the tables of their plugins: those that the file leaves at the default have names too, and setting one writes
it down.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import ValidationError

from robid_core.errors import ConfigurationError
from robid_core.robot.file.description import EffectEntry, RobotDescription
from robid_core.robot.file.effect_class import effect_class
from robid_core.robot.file.parameter_places import (
    DYNAMIC,
    ParameterPlace,
    TableRow,
    is_prismatic,
    linear_unit,
    motor_slides,
    places_of_structure,
)
from robid_core.robot.file.part import Part, line_errors
from robid_core.robot.file.wording import reason
from robid_core.yaml_file.problems import KeyPath, suggestion

Layout = Mapping[str, ParameterPlace]


class NamedParameter(NamedTuple):
    """A parameter of the robot: its value, and where it stands in the description."""

    name: str
    kind: str
    group: str
    unit: str
    path: KeyPath
    value: float


def layout_of(description: RobotDescription) -> dict[str, ParameterPlace]:
    """Return the place of every number that has a name, in the order of the file, effects last.

    Raises
    ------
    ConfigurationError
        Where an effect is not installed, or has no parameter of a name that the description sets.
    """
    return places_of_structure(description) | places_of_effects(description)


def places_of_effects(description: RobotDescription) -> dict[str, ParameterPlace]:
    """Return the place of every parameter of an effect, those at their default included; raises as `layout_of`."""
    found = {}
    for label, entry in description.effects.items():
        table = effect_table(entry.use)
        _refuse_misfits(description, label, entry, table)
        behind = entry.side in ("gear", "arm")
        slides = (is_prismatic if behind else motor_slides)(description, entry.on)
        for row in table:
            name = f"effect.{label}.{row.name}"
            path = ("effects", label, "with", row.name)
            # the phase of a wave is an angle on any axis
            unit = linear_unit(row.unit) if slides and row.name != "phase" else row.unit
            found[name] = ParameterPlace(name, "effect", DYNAMIC, unit, path, row)
    return found


def _refuse_misfits(
    description: RobotDescription, label: str, entry: EffectEntry, table: Sequence[TableRow]
) -> None:
    wrong = misfits(entry.use, entry.with_, table)
    if wrong:
        raise ConfigurationError(
            "\n".join(
                f"{description.name}: effects.{label}: {name}: {reason}" for name, reason in wrong.items()
            )
        )


def named_parameters(description: RobotDescription) -> dict[str, NamedParameter]:
    """Return every parameter that can be estimated or set by name, with its value; raises as `layout_of`."""
    return {
        name: NamedParameter(
            name, place.kind, place.group, place.unit, place.path, number_at(description, place)
        )
        for name, place in layout_of(description).items()
    }


def number_at(description: RobotDescription, place: ParameterPlace) -> float:
    """Return the value of one parameter."""
    section, entry, *inner = place.path
    if place.row is not None:
        return float(description.effects[str(entry)].with_.get(place.row.name, place.row.default))
    value: Any = getattr(description, str(section))[entry]
    for key in inner:
        value = value[key] if isinstance(key, int) else getattr(value, key)
    return float(value)


def effect_table(use: str) -> Sequence[TableRow]:
    """Return the table of an effect's parameters.

    Raises ConfigurationError where no effect has that name (with what comes near), or what is registered is none;
    PluginError where its plugin cannot be imported.
    """
    table: Sequence[TableRow] = effect_class(use).parameters
    return table


def misfits(use: str, values: Mapping[str, float], table: Sequence[TableRow]) -> dict[str, str]:
    """Return what is wrong with the values of an effect's parameters, by parameter; empty where all fit."""
    rows = {row.name: row for row in table}
    wrong = {}
    for name, value in values.items():
        if name not in rows:
            wrong[name] = f"effect '{use}' has no parameter '{name}'; {suggestion(name, rows, 'it has')}"
        elif not rows[name].lower <= value <= rows[name].upper:
            row = rows[name]
            wrong[name] = f"{value:g} is outside {row.lower:g} to {row.upper:g} {row.unit}".rstrip()
    return wrong


def with_values(
    description: RobotDescription, values: Mapping[str, float], layout: Layout | None = None
) -> RobotDescription:
    """Return the description with some named parameters changed; `layout` is that of the description, if known.

    Raises
    ------
    KeyError
        For an unknown name.
    ValidationError
        For a value that the parameter cannot have, at its place in the description.
    ConfigurationError
        For a value outside the bounds of an effect's table.
    """
    layout = layout_of(description) if layout is None else layout
    numbers: dict[KeyPath, float] = {}
    for name, value in values.items():
        path = layout[name].path
        numbers[path] = float(value)
        if "inertia" in path:  # symmetric: both entries
            numbers[(*path[:-2], path[-1], path[-2])] = float(value)
    sections: dict[str, Any] = {}
    for section, inside in _by_first(numbers).items():
        sections[str(section)] = _replaced(getattr(description, str(section)), inside, (section,))
    changed = description.model_copy(update=sections)
    for label in {str(path[1]) for path in numbers if path[0] == "effects"}:
        entry = changed.effects[label]
        _refuse_misfits(changed, label, entry, effect_table(entry.use))
    return changed


def with_parameters(
    description: RobotDescription, values: Mapping[str, float], layout: Layout | None = None
) -> RobotDescription:
    """Return the description as `with_values`; ConfigurationError tells what it does not have or cannot be."""
    layout = layout_of(description) if layout is None else layout
    unknown = [name for name in values if name not in layout]
    if unknown:
        raise ConfigurationError(
            f"{description.name} has no parameter {', '.join(unknown)}; {suggestion(unknown[0], layout, 'it has')}"
        )
    try:
        return with_values(description, values, layout)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ConfigurationError(f"{description.name}: {place}: {reason(first)}") from error


def _by_first(numbers: Mapping[KeyPath, float]) -> dict[str | int, dict[KeyPath, float]]:
    """Return the numbers by the first step of their path, with the rest of it."""
    found: dict[str | int, dict[KeyPath, float]] = {}
    for (first, *rest), value in numbers.items():
        found.setdefault(first, {})[tuple(rest)] = value
    return found


def _replaced(old: Any, numbers: Mapping[KeyPath, float], place: KeyPath) -> Any:
    """Return a part of the description with some numbers replaced; only parts that hold them are checked again."""
    if () in numbers:
        return numbers[()]
    if isinstance(old, EffectEntry):
        with_ = dict(old.with_) | {str(path[1]): value for path, value in numbers.items()}
        return _checked(old, {"with": with_}, place)
    inside = _by_first(numbers)
    if isinstance(old, tuple):
        return tuple(
            _replaced(entry, inside[k], (*place, k)) if k in inside else entry for k, entry in enumerate(old)
        )
    if isinstance(old, dict):
        return {
            key: _replaced(entry, inside[key], (*place, key)) if key in inside else entry
            for key, entry in old.items()
        }
    own = {str(key): _replaced(getattr(old, str(key)), rest, (*place, key)) for key, rest in inside.items()}
    if all(isinstance(value, Part) or _holds_parts(value) for value in own.values()):
        return old.model_copy(update=own)
    return _checked(old, own, place)


def _checked(old: Part, own: dict[str, Any], place: KeyPath) -> Part:
    """Return a part with some fields replaced, checked; errors are told at its place in the description."""
    fields = {info.alias or name: getattr(old, name) for name, info in type(old).model_fields.items()}
    try:
        return type(old).model_validate(fields | own)
    except ValidationError as error:
        raise ValidationError.from_exception_data(error.title, line_errors(error, place)) from None


def _holds_parts(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], Part)
