"""What can be estimated or set in a robot by name: `gear_stiffness.axis_2`, `effect.grease.breakaway`.

A name leads to a number of the description, its unit and its group. Parameters of effects come from the tables of
their plugins: those that the file leaves at the default have names too, and setting one writes it down.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from pydantic import ValidationError

from robid_core.errors import ConfigurationError
from robid_core.registry import EFFECTS, load_plugin
from robid_core.robot.description import EffectEntry, RobotDescription
from robid_core.robot.part import Part, Path, line_errors

# (group, unit, path) of every named parameter; {} is the name of the axis or bearing.
_AXIS_PARAMETERS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("gear_stiffness.{}", "stiffness", "N m/rad", ("gear", "stiffness")),
    ("gear_damping.{}", "damping", "N m s/rad", ("gear", "damping")),
    ("rotor_inertia.{}", "inertia", "kg m^2", ("rotor_inertia",)),
    ("torque_constant.{}", "drive", "N m/A", ("torque_constant",)),
    ("friction.{}.coulomb", "friction", "N m", ("friction", "coulomb")),
    ("friction.{}.viscous", "friction", "N m s/rad", ("friction", "viscous")),
    ("friction.{}.offset", "friction", "N m", ("friction", "offset")),
)
_BEARING_PARAMETERS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("bearing_stiffness.{}", "stiffness", "N m/rad", ("stiffness",)),
    ("bearing_damping.{}", "damping", "N m s/rad", ("damping",)),
)
_LINEAR_UNITS = {
    "N m/rad": "N/m",
    "N m s/rad": "N s/m",
    "kg m^2": "kg",
    "N m/A": "N/A",
    "N m": "N",
}


class TableRow(Protocol):
    """What is read of a row in an effect's table (`robid_core.effect.Parameter`)."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def default(self) -> float: ...
    @property
    def lower(self) -> float: ...
    @property
    def upper(self) -> float: ...


class NamedParameter(NamedTuple):
    """A parameter of the robot: its value, and where it stands in the description."""

    name: str
    group: str
    """stiffness, damping, modal, inertia, friction, drive or effect."""
    unit: str
    path: Path
    value: float


def named_parameters(description: RobotDescription) -> dict[str, NamedParameter]:
    """Return every parameter that can be estimated or set by name, in the order of the file.

    Raises
    ------
    ConfigurationError
        Where an effect is not installed, or has no parameter of a name that the description sets.
    """
    found: list[NamedParameter] = []
    where: Path
    prismatic = {body.joint for body in description.bodies if body.type == "prismatic"}
    for pattern, group, unit, path in _AXIS_PARAMETERS:
        for name, axis in description.axes.items():
            if path[0] == "gear" and axis.gear is None:
                continue
            linear = (axis.joint or name) in prismatic
            unit_here = _LINEAR_UNITS[unit] if linear else unit
            place = ("axes", name, *path)
            found.append(NamedParameter(pattern.format(name), group, unit_here, place, _number(axis, path)))
    for pattern, group, unit, path in _BEARING_PARAMETERS:
        for name, bearing in description.bearings.items():
            place = ("bearings", name, *path)
            found.append(NamedParameter(pattern.format(name), group, unit, place, _number(bearing, path)))
    for pattern, group, unit, path in _BEARING_PARAMETERS:
        for index, body in enumerate(description.bodies):
            if body.elastic is not None:
                unit_here = _LINEAR_UNITS[unit] if body.joint in prismatic else unit
                where = ("bodies", index, "elastic", *path)
                value = _number(body.elastic, path)
                found.append(NamedParameter(pattern.format(body.joint), group, unit_here, where, value))
    for index, body in enumerate(description.bodies):
        reduced = body.flexible.reduced if body.flexible is not None else None
        for k, mode in enumerate(reduced.modes if reduced is not None else ()):
            for kind, unit, value in (
                ("stiffness", "1/s^2", mode.stiffness),
                ("damping", "1/s", mode.damping),
            ):
                inside: Path = ("bodies", index, "flexible", "reduced", "modes", k, kind)
                name = f"modal_{kind}.{body.joint}_mode_{k + 1}"
                found.append(NamedParameter(name, "modal", unit, inside, value))
    for index, body in enumerate(description.bodies):
        if body.mass > 0:
            where = ("bodies", index, "mass")
            found.append(NamedParameter(f"mass.{body.joint}", "inertia", "kg", where, body.mass))
    found += effect_parameters(description)
    return {parameter.name: parameter for parameter in found}


def effect_parameters(description: RobotDescription) -> list[NamedParameter]:
    """Return the parameters of every effect, those at their default included; raises as `named_parameters`."""
    found = []
    for label, entry in description.effects.items():
        table = effect_table(entry.use)
        wrong = misfits(entry.use, entry.with_, table)
        if wrong:
            raise ConfigurationError(
                "\n".join(
                    f"{description.name}: effects.{label}: {name}: {reason}" for name, reason in wrong.items()
                )
            )
        for row in table:
            place = ("effects", label, "with", row.name)
            value = float(entry.with_.get(row.name, row.default))
            found.append(NamedParameter(f"effect.{label}.{row.name}", "effect", row.unit, place, value))
    return found


def effect_table(use: str) -> Sequence[TableRow]:
    """Return the table of an effect's parameters.

    Raises ConfigurationError where no effect has that name (with what comes near), PluginError where its plugin
    cannot be imported.
    """
    effect = load_plugin(EFFECTS, use)
    table: Sequence[TableRow] | None = getattr(effect, "parameters", None)
    if table is None or callable(table):
        raise ConfigurationError(f"effect '{use}' has no table of parameters; is {effect!r} an Effect?")
    return table


def misfits(use: str, values: Mapping[str, float], table: Sequence[TableRow]) -> dict[str, str]:
    """Return what is wrong with the values of an effect's parameters, by parameter; empty where all fit."""
    rows = {row.name: row for row in table}
    wrong = {}
    for name, value in values.items():
        if name not in rows:
            near = difflib.get_close_matches(name, rows, n=1, cutoff=0.6)
            hint = f"did you mean '{near[0]}'?" if near else f"it has: {', '.join(rows) or 'none'}"
            wrong[name] = f"effect '{use}' has no parameter '{name}'; {hint}"
        elif not rows[name].lower <= value <= rows[name].upper:
            row = rows[name]
            wrong[name] = f"{value:g} is outside {row.lower:g} to {row.upper:g} {row.unit}".rstrip()
    return wrong


def with_values(description: RobotDescription, values: Mapping[str, float]) -> RobotDescription:
    """Return the description with some named parameters changed.

    Raises
    ------
    KeyError
        For an unknown name.
    ValidationError
        For a value that the parameter cannot have, at its place in the description.
    ConfigurationError
        For a value outside the bounds of an effect's table.
    """
    parameters = named_parameters(description)
    numbers = {parameters[name].path: float(value) for name, value in values.items()}
    sections: dict[str, Any] = {}
    for (section, entry), inner in _grouped(numbers).items():
        old = sections.get(section, getattr(description, section))
        part = _replaced(old[entry], inner, (section, entry))
        sections[section] = (
            {**old, entry: part} if isinstance(old, dict) else (*old[:entry], part, *old[entry + 1 :])
        )
    changed = description.model_copy(update=sections)
    if "effects" in sections:
        effect_parameters(changed)  # bounds of the tables
    return changed


def _grouped(numbers: Mapping[Path, float]) -> dict[tuple[str, Any], dict[Path, float]]:
    """Return the numbers of each entry of a section, by their path inside it."""
    found: dict[tuple[str, Any], dict[Path, float]] = {}
    for (section, entry, *inner), value in numbers.items():
        found.setdefault((str(section), entry), {})[tuple(inner)] = value
    return found


def _replaced(part: Part, numbers: Mapping[Path, float], place: Path) -> Part:
    """Return a part with some numbers replaced; only the parts that hold them are checked again."""
    own: dict[str, Any] = {}
    nested: dict[str, dict[Path, float]] = {}
    for (key, *inner), value in numbers.items():
        if isinstance(part, EffectEntry):
            own.setdefault("with", dict(part.with_))[str(inner[0])] = value
        elif inner:
            nested.setdefault(str(key), {})[tuple(inner)] = value
        else:
            own[str(key)] = value
    for key, inside in nested.items():
        old = getattr(part, key)
        if isinstance(old, tuple):  # of parts: one more step down
            own[key] = tuple(
                _replaced(entry, {p[1:]: v for p, v in inside.items() if p[0] == k}, (*place, key, k))
                if any(p[0] == k for p in inside)
                else entry
                for k, entry in enumerate(old)
            )
        else:
            own[key] = _replaced(old, inside, (*place, key))
    if own.keys() == nested.keys():
        return part.model_copy(update=own)
    fields = {info.alias or name: getattr(part, name) for name, info in type(part).model_fields.items()}
    try:
        return type(part).model_validate(fields | own)
    except ValidationError as error:
        raise ValidationError.from_exception_data(error.title, line_errors(error, place)) from None


def _number(part: Part, path: Path) -> float:
    value: Any = part
    for key in path:
        value = getattr(value, str(key))
    return float(value)
