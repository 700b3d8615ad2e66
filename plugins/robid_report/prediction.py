"""How far models are from a record, axis by axis, as rows of text."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from robid_core import Diagnosis, PredictionErrors
from robid_report.numbers import percent, significant


def error_sections(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return for each quantity its models and a row for each axis; a cell is (error in its unit, share, interval)."""
    errors = diagnosis.errors if diagnosis is not None else ()
    sections = []
    for quantity, group in itertools.groupby(errors, key=lambda one: one.quantity):
        models = list(group)
        rows = [
            (axis, bool(models[0].still[a]), [_cell(one, a) for one in models])
            for a, axis in enumerate(models[0].axis_names)
        ]
        sections.append({"quantity": quantity, "models": [one.model for one in models], "rows": rows})
    return sections


def _cell(errors: PredictionErrors, axis: int) -> tuple[str, str, str]:
    low, high = errors.low[axis], errors.high[axis]
    between = (
        f"{significant(100 * low, 3)} to {significant(100 * high, 3)} %" if np.isfinite(low + high) else "–"
    )
    size = f"{significant(errors.rms[axis], 3)} {errors.unit_symbol}"
    return size, percent(float(errors.relative[axis])), between
