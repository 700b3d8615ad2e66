"""Where a model misfits: a table by axis and band, and the residual in standard errors over frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup
from scipy.special import gammaincinv

from robid_core import Diagnosis, Fit, FloatArray, MisfitTable
from robid_report.chart import chart
from robid_report.numbers import significant

LOWEST = 3.0  # the first band begins at zero, which no logarithmic axis shows: so much below its end it is drawn from
ROOM = 1.5  # above and below one, at least: a residual of 1.02 standard errors looks as close to one as it is
MARGIN = 1.1
LEAST = 0.05  # standard errors: less is drawn there


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
            limits, scatter = _limits(table), _scatter(table)
            pictures = [(name, _picture(table, a, limits)) for a, name in enumerate(table.axis_names)]
            found.append(
                {
                    "model": model,
                    "bands": table.band_names,
                    "rows": named,
                    "pictures": pictures,
                    "scatter": scatter is not None,
                }
            )
    return found


def _scatter(table: MisfitTable) -> tuple[FloatArray, FloatArray] | None:
    """Return between which residuals in standard errors 95 % lie where the model is right, (n_axis, n_band) each.

    The root of a chi-square variable over its degrees of freedom: of the lines where a band has some, else of the other
    bins, which are more.
    """
    if table.line_freedom is None or table.other_freedom is None:
        return None
    freedom = np.where(table.line_freedom > 0, table.line_freedom, table.other_freedom)
    half = np.where(freedom > 0, freedom, np.nan) / 2
    low, high = (np.sqrt(gammaincinv(half, chance) / half) for chance in (0.025, 0.975))
    return np.maximum(low, LEAST), high


def _limits(table: MisfitTable) -> tuple[float, float]:
    """Return the range of the ordinates of all axes: all that is drawn, one, and what chance does about it."""
    drawn = [np.ones(1), np.sqrt(table.lines).ravel(), np.sqrt(table.other).ravel()]
    drawn += [edge.ravel() for edge in _scatter(table) or ()]
    every = np.concatenate(drawn)
    every = np.maximum(every[np.isfinite(every)], LEAST)
    return float(min(every.min() / MARGIN, 1 / ROOM)), float(max(every.max() * MARGIN, ROOM))


def _picture(table: MisfitTable, axis: int, limits: tuple[float, float]) -> Markup | None:
    """Root of the misfit as steps over the bands; None where no band of the axis has a bin."""
    edges = table.band_edges_hz.copy()
    edges[0] = edges[0] or edges[1] / LOWEST
    frequency = np.repeat(edges, 2)[1:-1]
    sizes = {"law": table.lines[axis], "even": table.other[axis]}
    lines: dict[str, FloatArray] = {"torque": np.ones_like(frequency)}
    for name, misfit in sizes.items():
        if np.isfinite(misfit).any():
            lines[name] = np.maximum(np.repeat(np.sqrt(misfit), 2), LEAST)
    if len(lines) == 1:
        return None
    scatter = _scatter(table)
    return chart(
        "frequency, Hz",
        "std. errors",
        frequency,
        {},
        lines,
        spoken=f"residual of {table.axis_names[axis]} in standard errors over frequency",
        logarithmic=(True, True),
        ordinate="residual (rms)",
        limits=limits,
        band=None if scatter is None else (np.repeat(scatter[0][axis], 2), np.repeat(scatter[1][axis], 2)),
    )
