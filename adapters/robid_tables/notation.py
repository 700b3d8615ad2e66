"""How numbers are written in cells of a table, and in what other ways than ours people write them.

A number of ours is `-1.5e-3`, NaN or infinity. What looks like one in another notation (`1,5`, `1'234`, `5 Nm`) is
never taken for a word: `foreign_notation` says what it is. Dates, times of day and labels are words.
"""

from __future__ import annotations

import math
import re

NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|nan|inf|infinity)", re.IGNORECASE)
DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:e[+-]?[0-9]+)?", re.IGNORECASE)
# One comma before three digits, as in 1,234: the number may be near one, or above a thousand.
TWO_MEANINGS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
# A comma in a line that cannot separate thousands: other than three digits follow, or 0, nothing, four digits precede.
CERTAIN_COMMA = re.compile(
    r",[0-9]{1,2}(?![0-9,])|,[0-9]{4,}|(?<![0-9.,])0[0-9]*,[0-9]|(?<![0-9,]),[0-9]|[0-9]{4,},[0-9]|,[0-9]+[eE]"
)
MISSING = frozenset(
    {"na", "n/a", "#n/a", "null", "none", "nil", "missing", "-", "--", "?", "nan(ind)", "-nan(ind)"}
)
UNITS = frozenset(
    {
        "rad", "mrad", "deg", "degree", "degrees", "°", "turn", "rev", "m", "mm", "um", "µm", "s", "sec", "ms", "us",
        "µs", "ns", "min", "rad/s", "deg/s", "°/s", "rpm", "1/min", "m/s", "mm/s", "rad/s^2", "rad/s2", "rad/s²",
        "rad/s/s", "deg/s^2", "deg/s2", "deg/s²", "°/s^2", "°/s²", "m/s^2", "m/s2", "m/s²", "nm", "n m", "n.m", "n*m",
        "n·m", "mnm", "knm", "n", "kn", "a", "ma", "v", "mv", "w", "kw", "hz", "khz", "°c", "degc", "c", "k", "%",
        "counts", "count", "inc", "increments", "ticks",
    }
)  # fmt: skip

_DATE = re.compile(r"[0-9]{1,4}([-/.:])[0-9]{1,2}(?:\1[0-9]{1,4}.*|(?<=:..)(?:\.[0-9]+)?| .*)", re.DOTALL)
_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(?:([ ,.'’\u00a0\u202f_])[0-9]{3})(?:\1[0-9]{3})*(?:[.,][0-9]*)?")
_FORTRAN = re.compile(r"[+-]?[0-9]*\.?[0-9]*d[+-]?[0-9]+", re.IGNORECASE)
_WITH_WORD = re.compile(
    r"([+-]?[0-9]*[.,]?[0-9]+(?:e[+-]?[0-9]+)?)\s*([^\s0-9.,'].*)", re.IGNORECASE | re.DOTALL
)
_BEGINS = re.compile(r"[+-]?[.,]?[0-9]")


def number(cell: str, mark: str = ".") -> float | None:
    """Return the number in a cell, NaN where it is empty, None where it is no number with this decimal mark."""
    if not cell:
        return math.nan
    if mark == "," and "," in cell:
        return float(cell.replace(",", ".")) if DECIMAL_COMMA.fullmatch(cell) else None
    return float(cell) if NUMBER.fullmatch(cell) else None


def is_number(cell: str) -> bool:
    """Tell whether a cell holds a number, with a point or a comma."""
    return bool(NUMBER.fullmatch(cell) or DECIMAL_COMMA.fullmatch(cell))


def is_date(cell: str) -> bool:
    """Tell whether a cell holds a date or a time of day."""
    return bool(_DATE.fullmatch(cell))


def is_unit(cell: str) -> bool:
    """Tell whether a cell is a unit: in brackets, or a known one."""
    return bare_unit(cell) != cell or cell.lower() in UNITS


def bare_unit(cell: str) -> str:
    """Return a unit without its brackets."""
    inside = re.fullmatch(r"\[([^\[\]]*)\]|\(([^()]*)\)|<([^<>]*)>", cell)
    return next((part.strip() for part in inside.groups() if part is not None), cell) if inside else cell


def foreign_notation(cell: str) -> str:
    """Say what number in another notation a cell looks like; empty where it is a word, or a number of ours."""
    if NUMBER.fullmatch(cell) or is_date(cell):
        return ""
    plain = cell.replace("\u2212", "-")
    if plain != cell and (NUMBER.fullmatch(plain) or foreign_notation(plain)):
        return "a number with a typographic minus sign; write '-'"
    if TWO_MEANINGS.fullmatch(cell):
        small, large = cell.replace(",", "."), cell.replace(",", "")
        return f"{small} with a decimal comma or {large} with thousands set apart; write decimal points"
    if DECIMAL_COMMA.fullmatch(cell):
        return "a number with a decimal comma; write decimal points, not commas"
    if _THOUSANDS.fullmatch(cell):
        return "a number with thousands set apart; write the digits without a separator"
    if _FORTRAN.fullmatch(cell):
        return "a number with the exponent D; write E"
    worded = _WITH_WORD.fullmatch(cell)
    if worded and (is_unit(worded[2].strip()) or re.search("[.,]", worded[1])):
        return "a number with its unit; write the unit into the name of the column or a line below the header"
    if _BEGINS.match(cell) and not re.search(r"[^\W\d_]", cell):
        return "a number in a notation that is not known; write digits and a decimal point"
    return ""
