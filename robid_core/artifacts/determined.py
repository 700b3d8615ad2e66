"""How well data determine a number: at all, or by its tolerance, and to which digit; one rule for screen and page."""

from __future__ import annotations

import math

UNDETERMINED = 10.0
"""A standard error of so many times the value and more says nothing as a percentage."""

BY_TOLERANCE = 0.5
"""Of a tolerance: a standard error above it is the tolerance's rather than that of the data."""

DIGITS = 4
"""Of a number without a standard error."""

MOST_DIGITS = 9


def is_determined(error: float, value: float) -> bool:
    """Tell whether a standard error is of the size of the value at most, or there is none to compare.

    >>> import robid_core as robid
    >>> robid.is_determined(0.5, 4.0), robid.is_determined(1.0, 7e-6), robid.is_determined(1.0, 0.0)
    (True, False, True)
    """
    return not (value != 0 and error >= UNDETERMINED * abs(value))


def is_by_tolerance(error: float, tolerance: float) -> bool:
    """Tell whether a standard error is that of what was stated of a number; never where nothing was (infinite).

    >>> import robid_core as robid
    >>> robid.is_by_tolerance(0.09, 0.1), robid.is_by_tolerance(0.01, 0.1), robid.is_by_tolerance(0.1, float("inf"))
    (True, False, False)
    """
    return error > BY_TOLERANCE * tolerance


def significant_digits(error: float, value: float) -> int:
    """Tell with how many digits a value is written: to the second digit of its standard error.

    Two at least and nine at most; four where there is no error to compare.

    >>> import robid_core as robid
    >>> robid.significant_digits(10.0, 204_986.2), robid.significant_digits(890.0, 304_182.0)
    (6, 5)
    >>> f"{204_986.2:.{robid.significant_digits(10.0, 204_986.2)}g} ± 10"
    '204986 ± 10'
    """
    if not (value and math.isfinite(value) and 0 < error < math.inf):
        return DIGITS
    return min(max(_place(value, MOST_DIGITS) - _place(error, 2) + 2, 2), MOST_DIGITS)


def _place(value: float, digits: int) -> int:
    """Return the power of ten of the first digit, once rounded."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])
