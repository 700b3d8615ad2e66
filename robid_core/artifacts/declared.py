"""Whether a field holds what its class declares: Python asks nobody, and a file would keep it.

estimator: str                       text that a file can hold
axis_names: tuple[str, ...]          a tuple of them, no list
angle: FloatArray = array(...)       an array of real numbers, whole ones too; ComplexArray: any, BoolArray: yes or no
parameters: ParameterTable           an artifact of this class
"""

from __future__ import annotations

import types
import typing
from typing import Any

import numpy as np

KINDS = {
    "f": "fiu",
    "c": "fciu",
    "i": "iu",
    "b": "b",
}  # of numbers: by what is declared, what may stand there
IN_WORDS = {"f": "real numbers", "c": "numbers", "i": "whole numbers", "b": "yes or no"}
NO_NAMES = ("", ".", "..")
LARGEST = 2**63  # whole numbers of files have 64 bits


def declarations(kind: type) -> dict[str, Any]:
    """Return the declared type of each field of a class."""
    return typing.get_type_hints(kind)


def other_than(declared: Any, value: Any) -> str:
    """Say what a value is where it is not what is declared; empty where it is."""
    value = value.item() if isinstance(value, np.generic) else value  # as the file has it
    origin, inner = typing.get_origin(declared), typing.get_args(declared)
    if origin in (types.UnionType, typing.Union):
        first, *others = (other_than(one, value) for one in inner)
        return first if all([first, *others]) else ""
    if origin is np.ndarray:
        return _other_than_array(np.dtype(typing.get_args(inner[1])[0]).kind, value)
    if origin is typing.Literal:
        return "" if value in inner else f"{_named(value)}, not one of {', '.join(map(str, inner))}"
    if origin is tuple and isinstance(value, tuple):
        parts = [inner[0]] * len(value) if inner[1:] == (...,) else inner
        if len(parts) != len(value):
            return f"{len(value)} entries, not {len(parts)}"
        return next(
            (words for one, part in zip(parts, value, strict=True) if (words := other_than(one, part))), ""
        )
    if origin is dict and isinstance(value, dict):
        unnamed = [key for key in value if key in NO_NAMES or "/" in str(key)]
        if unnamed:
            return f"an entry called '{unnamed[0]}', which no file can have"
        pairs = [pair for key, part in value.items() for pair in ((inner[0], key), (inner[1], part))]
        return next((words for one, part in pairs if (words := other_than(one, part))), "")
    return _other_than_class(origin or declared, value)


def _other_than_array(wanted: str, value: Any) -> str:
    if not isinstance(value, np.ndarray):
        return f"{_named(value)}, not an array"
    if wanted in KINDS and value.dtype.kind not in KINDS[wanted]:
        return f"an array of {value.dtype}, not of {IN_WORDS[wanted]}"
    return ""


def _other_than_class(wanted: Any, value: Any) -> str:
    if not isinstance(wanted, type):  # Any
        return ""
    kinds = (int, float) if wanted is float else wanted
    if not isinstance(value, kinds) or (isinstance(value, bool) and wanted in (int, float)):
        return f"{_named(value)}, not {_article(wanted.__name__)}"
    if isinstance(value, int) and not -LARGEST <= value < LARGEST:
        return "a whole number beyond 64 bits"
    if isinstance(value, str):
        return _no_text(value)
    return ""


def _no_text(text: str) -> str:
    """Say why a file cannot hold a text, empty where it can."""
    if "\0" in text:
        return f"a text with the character NUL at {text.index(chr(0))}"
    try:
        text.encode()
    except UnicodeEncodeError as error:
        return f"half a character at {error.start} of a text"
    return ""


def _named(value: Any) -> str:
    return "nothing" if value is None else _article(type(value).__name__)


def _article(noun: str) -> str:
    return f"an {noun}" if noun[:1].lower() in set("aeiou") else f"a {noun}"
