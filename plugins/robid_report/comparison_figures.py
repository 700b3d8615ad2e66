"""Responses of several runs in one figure for each axis: a line for each run, the first broadest, below the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robid_core import Frf
from robid_core.plot import bode_layout

COLOURS = {
    "#24476b": "#8dbcec",
    "#c8501e": "#ff9364",
    "#4f7f6a": "#7fc4a4",
    "#8a5a9e": "#c79be0",
    "#a8861b": "#e0c25a",
    "#5b6875": "#a9b5c1",
}
"""Colours of runs, and what stands for each on a dark ground."""
WIDTHS = (1.2, 1.6)  # pixels: of the last line, and what each that lies below it is wider
FIRST_PHASE = 101  # number of the first phase axis of `bode_layout`
HEIGHT = 440
SAME_ANGLE = 1e-6  # rad


def shared_configurations(frfs: Sequence[Frf]) -> list[tuple[int, ...]]:
    """Return which configurations all responses have: for each of them its number in every response.

    A configuration is the same where all angles agree to a microradian; each response's is used once.
    """
    found = []
    for first, angle in enumerate(frfs[0].angle):
        numbers = [first]
        for other in frfs[1:]:
            same = np.flatnonzero((np.abs(other.angle - angle) <= SAME_ANGLE).all(axis=1))
            numbers += same[:1].tolist()
        if len(numbers) == len(frfs):
            found.append(tuple(numbers))
    return found


def overlaid(frfs: Mapping[str, Frf]) -> list[dict[str, Any]]:
    """Return the figures of the responses over their own torque, one for each shared configuration and axis.

    Parameters
    ----------
    frfs
        Responses by the label of their run, of the same axes.

    Returns
    -------
    Figures with `heading`, `data` and `layout`, plain values for JSON.
    """
    labels, responses = list(frfs), list(frfs.values())
    colours, last = list(COLOURS), len(labels) - 1
    figures = []
    for place, numbers in enumerate(shared_configurations(responses)):
        for axis, name in enumerate(responses[0].axis_names):
            traces: list[dict[str, Any]] = []
            for run, (label, frf, number) in enumerate(zip(labels, responses, numbers, strict=True)):
                valid = frf.valid_lines[number]
                value = frf.response[number, valid, axis, axis]
                colour, width = colours[run % len(colours)], WIDTHS[0] + WIDTHS[1] * (last - run)
                common = {
                    "x": [round(f, 6) for f in frf.frequency_hz[valid].tolist()],
                    "name": label,
                    "type": "scatter",
                    "mode": "lines+markers",
                    "line": {"color": colour, "width": round(width, 1)},
                    "marker": {"color": colour, "size": round(width + 2.2, 1)},
                }
                decibel = 20 * np.log10(np.maximum(np.abs(value), np.finfo(float).tiny))
                for y, shown in (("y", decibel), (f"y{FIRST_PHASE}", np.degrees(np.angle(value)))):
                    rounded = [round(one, 4) for one in shown.tolist()]
                    traces.append({**common, "y": rounded, "xaxis": "x", "yaxis": y})
            figures.append(
                {
                    "heading": f"{name}, configuration {place + 1}",
                    "data": traces,
                    "layout": bode_layout([(axis, axis, "")], 1, HEIGHT),
                }
            )
    return figures
