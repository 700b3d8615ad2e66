"""Which keys a mapping of a file may have, asked of the pydantic model that the file is checked against."""

from __future__ import annotations

import types
import typing
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from robid_core.yaml_file.problems import KeyPath


def fields_at(model: type[BaseModel], path: KeyPath) -> dict[str, FieldInfo]:
    """Return the keys that the mapping at a path inside a model may have; empty where there is no model."""
    annotation: Any = model
    for part in path:
        annotation = _inside(annotation, part)
    chosen = _model_in(annotation)
    return {} if chosen is None else {info.alias or name: info for name, info in chosen.model_fields.items()}


def first_line(field: FieldInfo | None) -> str:
    """Return what a key means, the first line of its description; empty where it has none."""
    return ((field.description or "") if field else "").partition("\n")[0].rstrip(".")


def _inside(annotation: Any, part: str | int) -> Any:
    """Return the annotation of an entry of whatever an annotation describes."""
    model = _model_in(annotation)
    if model is not None and isinstance(part, str):
        for name, info in model.model_fields.items():
            if part in (info.alias, name):
                return info.annotation
        return None
    for candidate in _members(annotation):
        arguments = [a for a in typing.get_args(candidate) if a is not Ellipsis]
        if arguments and typing.get_origin(candidate) is not None:
            return arguments[min(part, len(arguments) - 1)] if isinstance(part, int) else arguments[-1]
    return None


def _members(annotation: Any) -> list[Any]:
    """Return the members of a union, annotations taken off; the annotation itself otherwise."""
    if typing.get_origin(annotation) is typing.Annotated:
        return _members(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [member for a in typing.get_args(annotation) for member in _members(a)]
    return [annotation]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    found = [a for a in _members(annotation) if isinstance(a, type) and issubclass(a, BaseModel)]
    return found[0] if found else None
