"""What the page's script draws: figures of responses and of comparisons over time, and the words beside them."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core import ResponseComparison, TimeComparison
from robid_core.plot import bode_data, bode_layout, kept_samples, noun, traces
from robid_report.numbers import percent, significant

TALL = 440  # pixels of a figure that stands alone
LOW = 300  # of one in a row of several


def response_plots(comparison: ResponseComparison, fitted: bool) -> dict[str, Any]:
    """Return the figures of each configuration: of all axes over their own torque, and of each entry of the matrix.

    `rows` are figures of all axes by the element that shows them: `data[configuration]` goes with one of `layouts`, by
    the number of columns. `entries` has `data[configuration][output][input]`, left out where there is one axis only.
    """
    names, n_config = comparison.axis_names, len(comparison.measured)
    n = len(names)
    own = [(place, place, name) for place, name in enumerate(names)]
    alone = [(0, 0, "")]
    columns = range(1, 1 + (1 if n == 1 else 2 if n <= 4 else 3))
    height = TALL if n == 1 else LOW
    single = [
        [[bode_data(comparison, c, [(out, into, "")], fitted) for into in range(n)] for out in range(n)]
        for c in range(n_config if n > 1 else 0)
    ]
    return {
        "axes": list(names),
        "fitted": fitted,
        "rows": {
            "response-axes": {
                "data": [bode_data(comparison, c, own, fitted) for c in range(n_config)],
                "layouts": {k: bode_layout(own, k, height) for k in columns},
            },
        },
        "entries": {"data": single, "layouts": {1: bode_layout(alone, 1, TALL)}},
    }


def time_plots(comparison: TimeComparison, heading: str) -> dict[str, Any]:
    """Return one comparison: for each axis its figure and a note."""
    residual = comparison.measured - comparison.modelled
    axes = []
    for a, name in enumerate(comparison.axis_names):
        norm = float(np.linalg.norm(comparison.measured[:, a]))
        error = float(np.linalg.norm(residual[:, a])) / norm if norm else float("nan")
        rms = float(np.sqrt((residual[:, a] ** 2).mean()))
        note = f"relative error {percent(error)}, rms {significant(rms, 3)} {comparison.unit_symbol}"
        drawn = len(kept_samples(residual[:, a]))
        if drawn < len(residual):
            note += f"; {drawn} of {len(residual)} samples drawn, the extremes of the residual among them"
        axes.append({"name": name, "figure": traces(comparison, a), "note": note})
    return {
        "title": heading,
        "channel": noun(comparison),
        "error": percent(comparison.relative_error),
        "axes": axes,
    }
