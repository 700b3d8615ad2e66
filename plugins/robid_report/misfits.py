"""Where a model misfits: a table by axis and band, and the residual in standard errors over frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from robid_core import Diagnosis, Fit, FloatArray, MisfitTable
from robid_report.chart import chart
from robid_report.numbers import significant

LOWEST = 3.0  # the first band begins at zero, which no logarithmic axis shows: so much below its end it is drawn from


def misfit_sections(fit: Fit | None, diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Bands in words, a row of text and a picture for each axis: in each band the lines and the other bins."""
    tables = {
        "the model": fit.misfit_table if fit is not None else None,
        "the diagnosed robot": diagnosis.left if diagnosis is not None else None,
    }
    found = []
    for model, table in tables.items():
        if table is not None:
            pairs = np.stack([table.lines, table.other], axis=2).reshape(len(table.axis_names), -1)
            rows = [[significant(value, 3) for value in row] for row in pairs.tolist()]
            named = list(zip(table.axis_names, rows, strict=True))
            pictures = [(name, _picture(table, a)) for a, name in enumerate(table.axis_names)]
            found.append({"model": model, "bands": table.band_names, "rows": named, "pictures": pictures})
    return found


def _picture(table: MisfitTable, axis: int) -> Markup | None:
    """Root of the misfit as steps over the bands; None where no band of the axis has a bin."""
    edges = table.band_edges_hz.copy()
    edges[0] = edges[0] or edges[1] / LOWEST
    frequency = np.repeat(edges, 2)[1:-1]
    sizes = {"law": table.lines[axis], "even": table.other[axis]}
    lines: dict[str, FloatArray] = {"torque": np.ones_like(frequency)}
    for name, misfit in sizes.items():
        if np.isfinite(misfit).any():
            lines[name] = np.repeat(np.sqrt(misfit), 2)
    if len(lines) == 1:
        return None
    return chart(
        "frequency, Hz",
        "std. errors",
        frequency,
        {},
        lines,
        spoken=f"residual of {table.axis_names[axis]} in standard errors over frequency",
        logarithmic=(True, True),
        ordinate="residual (rms)",
    )
