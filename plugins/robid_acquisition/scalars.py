"""Single numbers of a file that are constants of its experiments, under a name and with a factor of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, FiniteFloat

from robid_acquisition.channel_values import select
from robid_core import DataRejected, FloatArray, Settings


class Scalar(Settings):
    """Where a constant comes from, and the factor that makes it what stages take it for."""

    column: str
    """Name in the file: a single number, or a column that holds one value."""
    scale: FiniteFloat = 1.0
    """Factor on the number of the file (0.001: grams that become kilograms)."""


def _by_name(value: Any) -> Any:
    """Let names of columns stand alone: `[kp]`, and `{payload_kg: payload}`."""
    if isinstance(value, list | tuple):
        return {name: {"column": name} for name in value}
    if isinstance(value, dict):
        return {name: {"column": one} if isinstance(one, str) else one for name, one in value.items()}
    return value


Scalars = Annotated[
    dict[str, Scalar],
    BeforeValidator(_by_name, json_schema_input_type=list[str] | dict[str, str | Scalar]),
]


def scalar_values(columns: dict[str, FloatArray], scalars: Mapping[str, Scalar]) -> dict[str, float]:
    """Return the constants of a file by name; DataRejected where one is missing, or is no single number."""
    found = {}
    for name, scalar in scalars.items():
        value = select(columns, scalar.column)
        known = value[np.isfinite(value)]
        if not known.size or (value.ndim > 1 and value.size > 1):
            why = f"has the shape {value.shape}" if value.size > 1 and known.size else "holds nothing"
            raise DataRejected(f"scalars: {scalar.column} {why}, and is no single number")
        if np.ptp(known):
            raise DataRejected(
                f"scalars: {scalar.column} goes from {known.min():g} to {known.max():g}, and is no constant"
            )
        found[name] = float(known[0]) * scalar.scale
    return found
