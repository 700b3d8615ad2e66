"""Numbers for people: significant digits, no more."""

from __future__ import annotations

import math
import re

from markupsafe import Markup, escape

from robid_core import significant_digits

_FOLDERS = re.compile(
    r"(?<![\w.)\]}/\\:])(?:file://)?(?:/|[A-Za-z]:[/\\])(?:[^\s/\\:;,'\"()<>]+[/\\])+(?=[^\s/\\])"
)
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def significant(value: float, digits: int = 4) -> str:
    """Write a number with so many significant digits: `412 300`, `0.0042`, `1.3×10⁻⁷`; a dash for NaN."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    rounded = float(f"{value:.{digits - 1}e}")
    magnitude = 0 if rounded == 0 else math.floor(math.log10(abs(rounded)))
    if not -4 <= magnitude < 7:
        mantissa = f"{rounded / 10.0**magnitude:.{digits - 1}f}"
        return f"{mantissa}×10{str(magnitude).translate(_RAISED)}".replace("-", "−")
    decimals = max(digits - 1 - magnitude, 0)
    return f"{rounded:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")


def to_error(value: float, error: float) -> str:
    """Write a value to the second digit of its standard error, as the terminal does.

    >>> to_error(204_986.2, 10.3)
    '204\u202f986'
    """
    return significant(value, significant_digits(error, value))


def with_error(value: float, error: float) -> str:
    """Write a value and its standard error, both to the second digit of the error.

    >>> with_error(0.30416, 0.0089)
    '0.3042 ± 0.0089'
    """
    return f"{to_error(value, error)} ± {significant(error, 2)}"


def percent(share: float, signed: bool = False) -> str:
    """Write a share as percent with three significant digits at most: `+2.31 %`; a dash for NaN."""
    if not math.isfinite(share):
        return "–"
    value = 100 * share
    decimals = 2 if abs(value) < 10 else 1 if abs(value) < 100 else 0
    if value != 0 and abs(value) < 0.1:
        decimals = 1 - math.floor(math.log10(abs(value)))
    text = f"{value:+.{decimals}f}" if signed else f"{value:.{decimals}f}"
    return text.replace("-", "−") + "\u202f%"


def times(count: int) -> str:
    """Say how often: once, twice, 5 times."""
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def counted(count: int, noun: str) -> str:
    """Say how many: 1 block, 2 blocks."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def without_folders(text: str) -> str:
    """Leave of each absolute path its last part: folders of a machine are nobody's business.

    >>> without_folders("read from /home/anna/cell 3.csv, C:\\\\data\\\\run\\\\a.mat; 5 N m/rad, (rad/s)/(N m)")
    'read from cell 3.csv, a.mat; 5 N m/rad, (rad/s)/(N m)'
    """
    return _FOLDERS.sub("", text)


LONG = 24  # letters; a longer part of a name may break within


def breakable(name: str) -> Markup:
    """Return a name for the page that breaks after its dots where it must, in long parts after underscores.

    >>> breakable("bearing_stiffness.axis_1_x")
    Markup('bearing_stiffness.<wbr>axis_1_x')
    """
    parts = [
        Markup("_<wbr>").join(part.split("_")) if len(part) > LONG else escape(part)
        for part in without_folders(name).split(".")
    ]
    return Markup(".<wbr>").join(parts)


def with_code(text: str) -> Markup:
    """Return a sentence for the page, with what stands between backticks as code, folders left out.

    >>> with_code("allow more steps (`passes` of the stage)")
    Markup('allow more steps (<code>passes</code> of the stage)')
    """
    parts = without_folders(text).split("`")
    if len(parts) % 2 == 0:  # one that is not closed stays as it is
        parts[-2:] = ["`".join(parts[-2:])]
    tagged = (
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )
    return Markup("").join(tagged)
