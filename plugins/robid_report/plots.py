"""What the page's script draws: figures of responses and of comparisons over time, and the words beside them."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core import ComplexArray, Frf, ResponseComparison, TimeComparison
from robid_core.plot import (
    DECADES,
    PANEL,
    bode_data,
    bode_layout,
    distortion_panels,
    kept_samples,
    level_of_response,
    noun,
    panel_layout,
    residual_panels,
    traces,
)
from robid_report.numbers import percent, significant

TALL = 440  # pixels of a figure that stands alone
LOW = 300  # of one in a row of several


def response_plots(
    comparison: ResponseComparison,
    fitted: bool,
    of_responses: bool,
    frf: Frf | None = None,
    spectra: tuple[ComplexArray, ComplexArray] | None = None,
) -> dict[str, Any]:
    """Return the figures of each configuration: of all axes over their own torque, and of each entry of the matrix.

    `rows` are figures of all axes by the element that shows them: `data[configuration]` goes with one of `layouts`, by
    the number of columns. Residuals are drawn beside a fit `of_responses` whose measurement has deviations, distortion
    where `frf` has its levels (with the level of the response from `spectra` of torques and accelerations). `entries`
    has `data[configuration][output][input]`, left out where there is one axis only.
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
    rows: dict[str, Any] = {
        "response-axes": {
            "data": [bode_data(comparison, c, own, fitted) for c in range(n_config)],
            "layouts": {k: bode_layout(own, k, height) for k in columns},
        }
    }
    if of_responses and np.isfinite(np.einsum("cfii->cfi", comparison.deviation)).any():
        rows["response-residuals"] = {
            "data": [residual_panels(comparison, c) for c in range(n_config)],
            "layouts": {
                k: panel_layout(names, "std. errors", k, PANEL, {"rangemode": "tozero"}) for k in columns
            },
        }
    if frf is not None and (frf.odd_distortion is not None or frf.even_distortion is not None):
        known = spectra is not None and len(spectra[1]) == n_config
        level = level_of_response(spectra[1]) if spectra is not None and known else None
        rows["response-distortion"] = {
            "data": [
                distortion_panels(frf, c, None if level is None else level[c])
                for c in range(len(frf.response))
            ],
            "layouts": {k: panel_layout(names, "rad/s²", k, PANEL, DECADES) for k in columns},
        }
    return {
        "axes": list(names),
        "fitted": fitted,
        "rows": rows,
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
