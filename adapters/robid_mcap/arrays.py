"""Arrays in messages: as whole increments where nothing is lost by it, else as they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray

_INTEGERS = ("<i2", "<i4")
_TYPES = {"<i2", "<i4", "<f8"}


@dataclass(frozen=True)
class Packed:
    """Values of shape (n_row, n_axis): bytes, their type, and the unit of an increment (empty: none)."""

    type: str
    content: bytes
    unit: tuple[float, ...]


def pack(values: FloatArray, unit: FloatArray | None) -> Packed:
    """Pack (n_row, n_axis) values; increments are chosen only where they give back the same bits."""
    if unit is not None and np.isfinite(values).all():
        counts = np.rint(values / unit)
        for name in _INTEGERS:
            limits = np.iinfo(name)
            fits = counts.size == 0 or (counts.min() >= limits.min and counts.max() <= limits.max)
            if fits and np.array_equal(counts * unit, values):
                return Packed(name, counts.astype(name).tobytes(), tuple(unit.tolist()))
    return Packed("<f8", np.ascontiguousarray(values, dtype="<f8").tobytes(), ())


def unpack(packed: Packed, n_axis: int) -> FloatArray:
    """Return the values of shape (n_row, n_axis); raises ValueError where the bytes do not fit."""
    if packed.type not in _TYPES:
        raise ValueError(f"unknown type of samples '{packed.type}'")
    flat: FloatArray = np.frombuffer(packed.content, dtype=np.dtype(packed.type)).astype(np.float64)
    values: FloatArray = flat.reshape(-1, n_axis)
    if packed.unit:
        if len(packed.unit) != n_axis:
            raise ValueError(f"{len(packed.unit)} units for {n_axis} axes")
        values = values * np.array(packed.unit)
    return values
