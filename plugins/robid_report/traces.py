"""Measured against simulated over time as compact numbers for the page's plots."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from robid_core import FloatArray, IntArray, TimeComparison
from robid_report.numbers import percent, rounded_to, significant

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


def plot_data(comparison: TimeComparison, title: str) -> dict[str, Any]:
    """Numbers of one comparison: for each axis time, measured, modelled and residual."""
    residual = comparison.measured - comparison.modelled
    axes = []
    for a, name in enumerate(comparison.axis_names):
        kept = kept_samples(residual[:, a])
        norm = float(np.linalg.norm(comparison.measured[:, a]))
        error = float(np.linalg.norm(residual[:, a])) / norm if norm else float("nan")
        rms = float(np.sqrt((residual[:, a] ** 2).mean()))
        axes.append(
            {
                "name": name,
                "time": rounded_to(comparison.time_s[kept], 6),
                "measured": rounded_to(comparison.measured[kept, a], 6),
                "modelled": rounded_to(comparison.modelled[kept, a], 6),
                "residual": rounded_to(residual[kept, a], 4),
                "note": f"relative error {percent(error)}, rms {significant(rms, 3)} {comparison.unit_symbol}",
            }
        )
    return {
        "title": title,
        "channel": noun(comparison),
        "unit": comparison.unit_symbol,
        "n_sample": len(residual),
        "error": percent(comparison.relative_error),
        "axes": axes,
    }
