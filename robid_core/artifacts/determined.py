"""Whether a number is determined by the data at all, or by its tolerance: one rule for screen, page and robot files."""

from __future__ import annotations

UNDETERMINED = 10.0
"""A standard error of so many times the value and more says nothing as a percentage."""

BY_TOLERANCE = 0.5
"""Of a tolerance: a standard error above it is the tolerance's rather than that of the data."""


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
