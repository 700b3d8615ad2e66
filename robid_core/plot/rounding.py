"""Numbers as plots need them: few digits, and nothing that JSON cannot hold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt


def compact(values: npt.NDArray[Any], decimals: int) -> Any:
    """Return nested lists rounded to `decimals`, None for NaN: what JSON takes and no longer than needed."""
    rounded = np.round(np.asarray(values, dtype=float), decimals)
    return _listed(rounded.tolist())


def rounded_to(values: npt.NDArray[Any], digits: int) -> Any:
    """Return nested lists rounded to `digits` significant digits of the largest entry, None for NaN."""
    array = np.asarray(values, dtype=float)
    largest = float(np.nanmax(np.abs(array), initial=0.0))
    decimals = digits - 1 - (math.floor(math.log10(largest)) if largest > 0 else 0)
    return compact(array, decimals)


def _listed(value: Any) -> Any:
    if isinstance(value, list):
        return [_listed(entry) for entry in value]
    if not math.isfinite(value):
        return None
    return int(value) if value == int(value) else value
