"""Whether a number is determined by the data at all: one rule for screen, page and robot files."""

from __future__ import annotations

UNDETERMINED = 10.0
"""A standard error of so many times the value and more says nothing as a percentage."""


def is_determined(error: float, value: float) -> bool:
    """Tell whether a standard error is of the size of the value at most, or there is none to compare.

    >>> import robid_core as robid
    >>> robid.is_determined(0.5, 4.0), robid.is_determined(1.0, 7e-6), robid.is_determined(1.0, 0.0)
    (True, False, True)
    """
    return not (value != 0 and error >= UNDETERMINED * abs(value))
