"""Numbers as plots need them: few digits, and nothing that JSON cannot hold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

MOST_DECIMALS = 15


def compact(values: npt.NDArray[Any], decimals: int) -> Any:
    """Return nested lists rounded to `decimals`, None for NaN: what JSON takes and no longer than needed."""
    rounded = np.round(np.asarray(values, dtype=float), decimals)
    return _listed(rounded.tolist())


def resolved(values: npt.NDArray[Any], decimals: int) -> Any:
    """Return nested lists rounded to `decimals`, and finer where the values span little: no staircase is drawn."""
    array = np.asarray(values, dtype=float)
    return compact(array, max(decimals, _decimals_of_span(array, 4)))


def rounded_to(values: npt.NDArray[Any], digits: int) -> Any:
    """Return nested lists rounded to `digits` significant digits of the largest entry, None for NaN.

    Of the span where that is smaller: no staircase is drawn.
    """
    array = np.asarray(values, dtype=float)
    largest = float(np.nanmax(np.abs(array), initial=0.0))
    decimals = digits - 1 - (math.floor(math.log10(largest)) if largest > 0 else 0)
    return compact(array, max(decimals, _decimals_of_span(array, digits)))


def _decimals_of_span(array: npt.NDArray[np.float64], digits: int) -> int:
    """Return how many decimals give `digits` significant digits of the difference of the extremes."""
    known = array[np.isfinite(array)]
    span = float(np.ptp(known)) if known.size else 0.0
    if span <= 1e-12 * float(np.abs(known).max(initial=0.0)):  # the same but for rounding
        return -MOST_DECIMALS
    return min(digits - 1 - math.floor(math.log10(span)), MOST_DECIMALS)


def _listed(value: Any) -> Any:
    if isinstance(value, list):
        return [_listed(entry) for entry in value]
    if not math.isfinite(value):
        return None
    return int(value) if value == int(value) else value
