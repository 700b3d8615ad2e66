"""Variables of MATLAB by plain names: structures are flattened to `rec.position`, their arrays to `rec(2).position`.

A value is an array with MATLAB's dimensions, a structure (dict), an array of structures (list), a cell array (tuple),
or `LeftOut` with what it is instead of numbers. Both generations of files are brought to this form.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from robid_core import FloatArray


class LeftOut(str):
    """What a variable holds that is no real number."""


def flattened(value: Any, name: str) -> Iterator[tuple[str, FloatArray | LeftOut]]:
    """Yield arrays of numbers by name, unit dimensions squeezed, and what else there is."""
    if isinstance(value, dict):
        for field, inner in value.items():
            yield from flattened(inner, f"{name}.{field}" if name else field)
    elif isinstance(value, list):
        for index, inner in enumerate(value, start=1):
            yield from flattened(inner, f"{name}({index})")
    elif isinstance(value, tuple):
        if value and not any(isinstance(inner, LeftOut) for inner in value):
            for index, inner in enumerate(value, start=1):
                yield from flattened(inner, f"{name}{{{index}}}")
        else:
            kinds = sorted({inner if isinstance(inner, LeftOut) else "numbers" for inner in value})
            yield name, LeftOut(f"a cell array of {' and '.join(kinds)}" if kinds else "an empty cell array")
    elif isinstance(value, LeftOut):
        yield name, value
    elif value.dtype.kind not in "fiub":
        yield name, LeftOut("complex numbers" if value.dtype.kind == "c" else "no plain numbers")
    elif not value.size:
        yield name, LeftOut("an empty array")
    else:
        yield name, np.squeeze(value).astype(np.float64)
