"""A part of a robot file checked against its model, and pydantic's errors in the words of the file.

Each message has the value that was written, what it must be, and what the key means with its unit. A typing error that
is also a missing key is one problem.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from robid_core.robot.file.document import Document
from robid_core.robot.file.part import Part, with_tuples
from robid_core.yaml_file.model_fields import fields_at, first_line
from robid_core.yaml_file.problems import KeyPath, nearest, suggestion

AnyPart = TypeVar("AnyPart", bound=Part)

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
_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
PLACEHOLDER = "fill_in"  # what robid init writes where only a person knows the value
_BOUNDS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}


def checked(model: type[AnyPart], data: Any, document: Document, prefix: KeyPath = ()) -> AnyPart | None:
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


def tell(error: ValidationError, model: type[Part], document: Document, prefix: KeyPath = ()) -> None:
    """Add every error of a model to the document, at its place below `prefix`."""
    unknown: dict[KeyPath, list[str]] = defaultdict(list)
    missing: dict[KeyPath, list[str]] = defaultdict(list)
    for item in error.errors(include_url=False):
        if item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]:
            continue  # pydantic counts what is right; the wrong ones are told
        location: KeyPath = tuple(part for part in item["loc"] if part != "[key]")
        if item["type"] == "extra_forbidden":
            unknown[location[:-1]].append(str(location[-1]))
        elif item["type"] == "missing" and isinstance(location[-1], str):
            missing[location[:-1]].append(location[-1])
        else:
            meaning = "" if item["type"] == "refused" else _meaning(model, location)
            message = reason(item)
            document.add((*prefix, *location), message + (f"; {meaning}" if meaning else ""))
    for place in {**unknown, **missing}:
        _tell_keys(unknown[place], missing[place], fields_at(model, place), document, (*prefix, *place))


def _tell_keys(
    unknown: list[str], missing: list[str], fields: dict[str, FieldInfo], document: Document, place: KeyPath
) -> None:
    waiting = list(missing)
    for key in unknown:
        meant = nearest(key, waiting)
        if meant is not None:
            waiting.remove(meant)
        hint = suggestion(key, [meant] if meant else list(fields), "the keys here are")
        if key.isdecimal():  # {mass: 12,5}
            hint = f"decimal comma? A comma parts the entries: write a point, as in 12.{key}"
        document.add((*place, key), f"unknown key '{key}'; {hint}")
    for key in waiting:
        document.add((*place, key), f"the key '{key}' is missing: {first_line(fields.get(key))}".rstrip(": "))


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
    if value == PLACEHOLDER:
        return f"still to fill in: {_KINDS.get(kind, 'a value')}"
    written = "nothing is written here" if value is None else f"{_short(value)} is written here"
    if kind == "float_type" and isinstance(value, str) and _COMMA.fullmatch(value.strip()):
        return f"{written}, it must be a number; decimal comma? Write {value.strip().replace(',', '.')}"
    return f"{written}, it must be {_KINDS[kind]}" if kind in _KINDS else f"{written}: {item['msg']}"


def _short(value: Any) -> str:
    text = str(value) if isinstance(value, int | float) else f"'{value}'" if isinstance(value, str) else ""
    text = text or (
        "a mapping" if isinstance(value, Mapping) else "a list" if isinstance(value, tuple) else repr(value)
    )
    return text if len(text) <= 60 else text[:57] + "..."


def _meaning(model: type[BaseModel], path: KeyPath) -> str:
    """Return what a key means: "stiffness: N m/rad, joint side"; what has none has the meaning of what holds it."""
    for length in range(len(path), 0, -1):
        field = fields_at(model, path[: length - 1]).get(str(path[length - 1]))
        if field is not None:
            return f"{path[length - 1]}: {first_line(field)}"
    return ""
