"""The values of plain YAML scalars by the core schema of YAML 1.2 (section 10.3.2), and by nothing older.

`yes` is text, `1:30` is text, `1_000` is text, `010` is ten, `0o10` is eight, dates are text.
"""

from __future__ import annotations

import re

Scalar = str | int | float | bool | None

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_TRUE = frozenset({"true", "True", "TRUE"})
_FALSE = frozenset({"false", "False", "FALSE"})
MOST_DIGITS = (
    300  # longer numbers stay text: no setting needs them, and Python refuses to convert very long ones
)
_INTEGER = re.compile(rf"[-+]?[0-9]{{1,{MOST_DIGITS}}}")
_OCTAL = re.compile(rf"0o[0-7]{{1,{MOST_DIGITS}}}")
_HEXADECIMAL = re.compile(rf"0x[0-9a-fA-F]{{1,{MOST_DIGITS}}}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(inf|Inf|INF)")
_NOT_A_NUMBER = re.compile(r"\.(nan|NaN|NAN)")


def plain_scalar(text: str) -> Scalar:
    """Return what an unquoted scalar means."""
    if text in _NULL:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if _INTEGER.fullmatch(text):
        return int(text)
    if _OCTAL.fullmatch(text):
        return int(text[2:], 8)
    if _HEXADECIMAL.fullmatch(text):
        return int(text[2:], 16)
    if _FLOAT.fullmatch(text) and len(text) <= MOST_DIGITS:
        return float(text)
    if _INFINITY.fullmatch(text):
        return float(text.replace(".", ""))
    if _NOT_A_NUMBER.fullmatch(text):
        return float("nan")
    return text
