"""A part of a robot file checked against its model, and pydantic's errors in the words of the file.

Each message has the value that was written, what it must be, and what the key means with its unit. A typing error that
is also a missing key is one problem.
"""

from __future__ import annotations

import difflib
import types
import typing
from collections import defaultdict
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from robid_core.robot.document import Document
from robid_core.robot.part import Part, Path, with_tuples
from robid_core.robot.problems import suggestion

Model = TypeVar("Model", bound=Part)

_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}


def checked(model: type[Model], data: Any, document: Document, prefix: Path = ()) -> Model | None:
    """Return the part that `data` describes; None where it has mistakes, which the document then knows.

    Parameters
    ----------
    model
        What is wanted.
    data
        Plain data, as the file has it at `prefix`.
    document
        Takes the mistakes.
    prefix
        Where `data` stands in the file.
    """
    try:
        return model.model_validate(with_tuples(data))
    except ValidationError as error:
        tell(error, model, document, prefix)
        return None


def tell(error: ValidationError, model: type[Part], document: Document, prefix: Path = ()) -> None:
    """Add every error of a model to the document, at its place below `prefix`."""
    unknown: dict[Path, list[str]] = defaultdict(list)
    missing: dict[Path, list[str]] = defaultdict(list)
    for item in error.errors(include_url=False):
        location: Path = tuple(part for part in item["loc"] if part != "[key]")
        if item["type"] == "extra_forbidden":
            unknown[location[:-1]].append(str(location[-1]))
        elif item["type"] == "missing" and isinstance(location[-1], str):
            missing[location[:-1]].append(location[-1])
        else:
            meaning = "" if item["type"] == "refused" else _meaning(model, location)
            message = reason(item)
            document.add((*prefix, *location), message + (f"; {meaning}" if meaning else ""))
    for place in {**unknown, **missing}:
        _tell_keys(unknown[place], missing[place], _fields(model, place), document, (*prefix, *place))


def _tell_keys(
    unknown: list[str], missing: list[str], fields: dict[str, FieldInfo], document: Document, place: Path
) -> None:
    waiting = list(missing)
    for key in unknown:
        meant = difflib.get_close_matches(key, waiting, n=1, cutoff=0.6)
        if meant:
            waiting.remove(meant[0])
        hint = suggestion(key, meant or list(fields), "the keys here are")
        document.add((*place, key), f"unknown key '{key}'; {hint}")
    for key in waiting:
        document.add(
            (*place, key), f"the key '{key}' is missing: {_first_line(fields.get(key))}".rstrip(": ")
        )


def reason(item: Mapping[str, Any]) -> str:
    """Return one error of pydantic in the words of the file: what is written, and what it must be."""
    kind, value, location = str(item["type"]), item.get("input"), item["loc"]
    if kind == "refused":
        return str(item["msg"])
    if "[key]" in location or kind == "string_pattern_mismatch":
        return f"'{value}' is no name; take letters, digits and underscores, a letter first"
    if kind == "missing":
        return f"the list is too short: item {location[-1]} (counted from 0) is missing"
    if kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        return f"{value!r} must be {words} {item['ctx'][bound]:g}"
    if kind == "literal_error":
        return f"{value!r} must be {item['ctx']['expected']}"
    if kind in ("too_short", "too_long"):
        actual, limit = (
            item["ctx"].get("actual_length"),
            item["ctx"].get("min_length", item["ctx"].get("max_length")),
        )
        return f"{actual} entries, there must be at {'least' if kind == 'too_short' else 'most'} {limit}"
    written = "nothing is written here" if value is None else f"{_short(value)} is written here"
    return f"{written}, it must be {_KINDS[kind]}" if kind in _KINDS else f"{written}: {item['msg']}"


def _short(value: Any) -> str:
    text = str(value) if isinstance(value, int | float) else f"'{value}'" if isinstance(value, str) else ""
    text = text or (
        "a mapping" if isinstance(value, Mapping) else "a list" if isinstance(value, tuple) else repr(value)
    )
    return text if len(text) <= 60 else text[:57] + "..."


def _meaning(model: type[BaseModel], path: Path) -> str:
    """Return what a key means: "stiffness: N m/rad, joint side"; what has none has the meaning of what holds it."""
    for length in range(len(path), 0, -1):
        field = _fields(model, path[: length - 1]).get(str(path[length - 1]))
        if field is not None:
            return f"{path[length - 1]}: {_first_line(field)}"
    return ""


def _first_line(field: FieldInfo | None) -> str:
    return ((field.description or "") if field else "").partition("\n")[0].rstrip(".")


def _fields(model: type[BaseModel], place: Path) -> dict[str, FieldInfo]:
    """Return the keys that a mapping inside a model may have."""
    annotation: Any = model
    for part in place:
        annotation = _inside(annotation, part)
    for member in _members(annotation):
        if isinstance(member, type) and issubclass(member, BaseModel):
            return {info.alias or name: info for name, info in member.model_fields.items()}
    return {}


def _inside(annotation: Any, part: str | int) -> Any:
    for member in _members(annotation):
        if isinstance(member, type) and issubclass(member, BaseModel):
            info = next((i for name, i in member.model_fields.items() if part in (i.alias, name)), None)
            return info.annotation if info else None
        arguments = [a for a in typing.get_args(member) if a is not Ellipsis]
        if arguments:
            return arguments[min(part, len(arguments) - 1)] if isinstance(part, int) else arguments[-1]
    return None


def _members(annotation: Any) -> list[Any]:
    """Return the members of a union, annotations taken off; the annotation itself otherwise."""
    if typing.get_origin(annotation) is typing.Annotated:
        return _members(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [member for a in typing.get_args(annotation) for member in _members(a)]
    return [annotation]
