"""Settings against their pydantic model, strictly as JSON, every error at its place in the file.

Pydantic finds the errors; here they are told in the file's terms. A typing error that is also a missing
setting is one problem. Values are never coerced: what YAML 1.2 read must be what the setting wants.
"""

from __future__ import annotations

import inspect
import json
import re
import typing
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from robid_core.errors import PluginError
from robid_core.yaml_file.model_fields import fields_at, first_line
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.problems import KeyPath, ProblemList, nearest, suggestion
from robid_core.yaml_file.scalars import MOST_DIGITS

AnyModel = TypeVar("AnyModel", bound=BaseModel)

_STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
_NOUNS = {
    "an object": "a mapping",
    "a valid array": "a list",
    "a valid list": "a list",
    "a valid integer": "a whole number",
    "a valid number": "a number",
    "a valid string": "text",
    "a valid boolean": "true or false",
    "a valid tuple": "a list",
    "a valid dictionary": "a mapping",
}
_SHOULD = "Input should be "
_ONE_OF = re.compile(r"\^\(([\w|]+)\)\$")  # a pattern that lists words
_CONTAINERS = {"List": "list", "Tuple": "list", "Set": "list", "Dictionary": "mapping"}
_BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number")
_OLD_BOOLEANS = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}


def settings_model(plugin: Any) -> type[BaseModel]:
    """Return the model of what `with:` may hold: the class itself, or the parameters of a function.

    Raises PluginError where the object is neither.
    """
    if isinstance(plugin, type) and issubclass(plugin, BaseModel):
        return plugin
    if not callable(plugin):
        raise PluginError(f"{plugin!r} is neither a class of settings nor a function")
    hints = typing.get_type_hints(plugin, include_extras=True)
    fields: dict[str, Any] = {}
    for parameter in inspect.signature(plugin).parameters.values():
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        default = ... if parameter.default is parameter.empty else parameter.default
        fields[parameter.name] = (hints.get(parameter.name, Any), default)
    name = getattr(plugin, "__name__", "settings")
    return create_model(name, __config__=_STRICT, __doc__=inspect.getdoc(plugin), **fields)


def check(
    model: type[AnyModel], node: Node, path: KeyPath, problems: ProblemList, context: Any = None
) -> AnyModel | None:
    """Validate a node against a model; None where problems were found, which are then in the list.

    Parameters
    ----------
    model
        What is wanted.
    node
        What the file says.
    path
        Where `node` stands in the file.
    problems
        Takes the mistakes.
    context
        Handed to the model's validators.
    """
    try:
        return model.model_validate_json(json.dumps(node.plain()), strict=True, context=context)
    except ValidationError as error:
        _tell(error, model, node, path, problems)
        return None
    except (ArithmeticError, MemoryError) as error:  # in a validator of the model's author
        words = (
            f"these numbers are too large or too small to be computed with ({type(error).__name__}: {error})"
        )
        problems.add(node.at(())[1], path, words)
        return None


def _tell(
    error: ValidationError, model: type[BaseModel], node: Node, path: KeyPath, problems: ProblemList
) -> None:
    """Translate pydantic's errors, grouped by the mapping or value they belong to."""
    unknown: dict[KeyPath, list[str]] = defaultdict(list)
    missing: dict[KeyPath, list[str]] = defaultdict(list)
    other: dict[KeyPath, list[Mapping[str, Any]]] = defaultdict(list)
    for item in error.errors(include_url=False):
        location = tuple(item["loc"])
        if item["type"] == "missing" and isinstance(location[-1], str):
            missing[node.at(location[:-1])[0]].append(str(location[-1]))
        elif item["type"] == "extra_forbidden":
            found = node.at(location)[0]
            unknown[found[:-1]].append(str(found[-1]))
        else:
            other[_place(item, node)].append(item)
    for place in {**unknown, **missing}:
        _tell_keys(unknown[place], missing[place], _keys(model, place), node, path, place, problems)
    for place, items in other.items():
        if not (problems.spoils(*path, *place) or _is_of_another_kind(place, items, other)):
            message, value = (
                _wording(items).removeprefix(f"{place[-1]}: " if place else ""),
                items[0].get("input"),
            )
            if isinstance(value, str) and items[0]["type"] == "model_type" and "use" in _keys(model, place):
                message += f"; write `{{use: {_short(value)}}}`"
            if place == ("stages",) and isinstance(value, list):
                message += "; write a name before each stage, no dash: `acquire: {use: acquisition.recorded}`"
            problems.add(node.at(place)[1], (*path, *place), message)


def _is_of_another_kind(place: KeyPath, items: list[Mapping[str, Any]], other: Mapping[KeyPath, Any]) -> bool:
    """Whether a value is only not of a kind that it is not meant to be: of another one it is wrong further inside."""
    inside = any(len(one) > len(place) and one[: len(place)] == place for one in other)
    return inside and all(str(item["type"]).endswith("_type") for item in items)


def _place(item: Mapping[str, Any], node: Node) -> KeyPath:
    """Return where an error stands; one of the whole mapping that begins `key: ` is meant for that key."""
    place = node.at(tuple(item["loc"]))[0]
    key = _message(item).partition(": ")[0]
    inside = node.find(place)
    return (*place, key) if item["type"] == "value_error" and inside and inside.get(key) else place


def _tell_keys(
    unknown: list[str],
    missing: list[str],
    known: Mapping[str, str],
    node: Node,
    path: KeyPath,
    place: KeyPath,
    problems: ProblemList,
) -> None:
    """Report unknown and missing keys of one mapping; a misspelt required key is both, and told once."""
    waiting = list(missing)
    for key in unknown:
        full = (*path, *place, key)
        if problems.spoils(*full):
            continue
        mark = node.at((*place, key))[1]
        meant = nearest(key, waiting) or nearest(key, list(known))
        if meant in waiting:
            waiting.remove(meant)
        elif meant is None and len(unknown) == len(waiting) == 1:
            problems.add(
                mark, full, f"unknown key '{key}'; the key '{waiting.pop()}' is missing: is it that?"
            )
            continue
        problems.add(mark, full, f"unknown key '{key}'; {suggestion(key, list(known), 'the keys here are')}")
    for key in waiting:
        full = (*path, *place, key)
        if not problems.spoils(*full):
            meaning = f": {known[key]}" if known.get(key) else ""
            problems.add(node.at(place)[1], full, f"the key '{key}' is missing{meaning}")


def _keys(model: type[BaseModel], place: KeyPath) -> dict[str, str]:
    """Return the keys a mapping inside a model may have, each with the first line of its description."""
    return {key: first_line(info) for key, info in fields_at(model, place).items()}


def _wording(items: list[Mapping[str, Any]]) -> str:
    """Return what is wrong with one value, and a hint where YAML and the user may read it differently."""
    beyond = [
        item for item in items if item["type"] in _BOUNDS
    ]  # of the right kind: other kinds are no advice
    messages = list(dict.fromkeys(_message(item) for item in beyond or items))
    wanted = [message.removeprefix(_SHOULD) for message in messages if message.startswith(_SHOULD)]
    told = [f"{_written(items[0].get('input'))}must be {' or '.join(wanted)}"] if wanted else []
    hint = _hint(items[0])
    others = [message for message in messages if not message.startswith(_SHOULD)]
    return " or ".join([*told, *others]) + (f"; {hint}" if hint else "")


def _written(value: Any) -> str:
    """What stands in the file; nothing where nothing does."""
    if isinstance(value, bool):
        return f"{str(value).lower()} "
    if isinstance(value, str):
        return f"'{_short(value)}' "
    if isinstance(value, Mapping | Sequence):
        return "this mapping " if isinstance(value, Mapping) else "this list "
    return f"{_short(repr(value))} " if isinstance(value, int | float) else ""


def _message(item: Mapping[str, Any]) -> str:
    if item["type"] == "missing":
        return f"the list is too short: item {item['loc'][-1]} (counted from 0) is missing"
    text = str(item["msg"])
    if item["type"] in ("value_error", "assertion_error"):
        return text.partition(", ")[2]
    if item["type"] == "string_pattern_mismatch" and (words := _ONE_OF.fullmatch(item["ctx"]["pattern"])):
        *first, last = words[1].split("|")
        return f"{_SHOULD}{', '.join(first)} or {last}"
    for theirs, ours in _NOUNS.items():
        text = text.replace(theirs, ours)
    text = re.sub("^(List|Tuple|Set|Dictionary) ", lambda noun: f"This {_CONTAINERS[noun[1]]} ", text)
    return " ".join(text.replace(" after validation", "").split())


def _hint(item: Mapping[str, Any]) -> str:
    value, kind = item.get("input"), str(item["type"])
    if kind == "bool_type" and isinstance(value, str) and value.casefold() in _OLD_BOOLEANS:
        return f"'{value}' is text in YAML 1.2; write {_OLD_BOOLEANS[value.casefold()]}"
    if kind == "int_type" and isinstance(value, float) and value.is_integer():
        return f"write {int(value)}"
    if kind in ("int_type", "float_type") and isinstance(value, str):
        if len(value) > MOST_DIGITS and value.lstrip("+-").isdecimal():
            return f"it has {len(value.lstrip('+-'))} digits, of which at most {MOST_DIGITS} are read"
        return ""
    if kind == "string_type" and isinstance(value, bool | int | float):
        return "write it in quotes if text is meant"
    if kind == "literal_error" and isinstance(value, str):
        near = nearest(
            value,
            [text.strip("'") for text in str(item["ctx"]["expected"]).replace(" or ", ", ").split(", ")],
        )
        return f"did you mean '{near}'?" if near else ""
    return "" if value is not None or kind == "missing" else "the value is empty"


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."
