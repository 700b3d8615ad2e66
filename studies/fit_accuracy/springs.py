"""Numbers of the springs in a table's rows: error, stated error and bound of each, in columns `error.<name>`."""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray
from studies.fit_accuracy.tables import Row

QUANTILE = 1.96  # of a normal distribution, 95 %


def names(rows: list[Row]) -> list[str]:
    """Springs that these rows have numbers of."""
    return [key.partition(".")[2] for key, value in rows[0].items() if key.startswith("error.") and value]


def columns(rows: list[Row], what: str) -> FloatArray:
    """Numbers of one kind (error, stated, bound), shape (n_row, n_spring)."""
    return np.array([[float(row[f"{what}.{name}"]) for name in names(rows)] for row in rows])
