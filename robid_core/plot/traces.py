"""Measured against simulated over time, and what is left between them."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.artifacts import TimeComparison
from robid_core.plot.rounding import rounded_to
from robid_core.plot.style import MEASURED, MODEL, RESIDUAL, TICK, Figure, axis, layout, plain, title

BUCKETS = 900  # a plot is about this many pixels wide


def kept_samples(residual: FloatArray, n_bucket: int = BUCKETS) -> IntArray:
    """Indices of the samples worth drawing: both extremes of the residual in each bucket, first and last sample.

    Parameters
    ----------
    residual
        Shape (n_sample,).
    n_bucket
        Parts of equal length; shorter recordings are kept whole.
    """
    n_sample = len(residual)
    if n_sample <= 2 * n_bucket:
        return np.arange(n_sample)
    edges = np.linspace(0, n_sample, n_bucket + 1).astype(np.int64)
    kept = {0, n_sample - 1}
    for first, stop in itertools.pairwise(edges.tolist()):
        kept.add(int(first + residual[first:stop].argmin()))
        kept.add(int(first + residual[first:stop].argmax()))
    return np.array(sorted(kept), dtype=np.int64)


def noun(comparison: TimeComparison) -> str:
    """Name the compared quantity; what newtons measure is a force."""
    name = comparison.channel.replace("_", " ")
    return name.replace("torque", "force") if comparison.unit_symbol == "N" else name


def traces(comparison: TimeComparison, axis_index: int) -> Figure:
    """Return the figure of one axis: measured and simulated above their difference."""
    measured, modelled = comparison.measured[:, axis_index], comparison.modelled[:, axis_index]
    residual = measured - modelled
    kept = kept_samples(residual)
    unit = plain(comparison.unit_symbol)
    time = rounded_to(comparison.time_s[kept], 6)

    def trace(values: FloatArray, digits: int, colour: str, width: float, name: str, where: str) -> Any:
        return {
            "x": time,
            "y": rounded_to(values[kept], digits),
            "mode": "lines",
            "name": name,
            "yaxis": where,
            "line": {"color": colour, "width": width},
            "hovertemplate": "%{x:.4g} s, %{y:.5g} " + unit + "<extra>" + name + "</extra>",
        }

    residual_axis = axis(domain=[0, 0.28], zeroline=True, zerolinecolor=TICK, nticks=4)
    return {
        "data": [
            trace(measured, 6, MEASURED, 1.6, "measured", "y"),
            trace(modelled, 6, MODEL, 1.1, "simulated", "y"),
            trace(residual, 4, RESIDUAL, 1.0, "residual", "y2"),
        ],
        "layout": layout(
            390,
            64,
            8,
            38,
            hovermode="x",
            xaxis=axis(anchor="y2", title=title("s")),
            yaxis=axis(domain=[0.36, 1], title=title(f"{noun(comparison)} / {comparison.unit_symbol}")),
            yaxis2={**residual_axis, "title": title(f"residual / {comparison.unit_symbol}")},
        ),
    }
