"""Responses of several runs in one figure for each axis: magnitude over frequency, a line for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robid_core import Frf
from robid_core.plot import bode_layout

COLOURS = ("#24476b", "#c8501e", "#4f7f6a", "#8a5a9e", "#a8861b", "#5b6875")
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
    figures = []
    for place, numbers in enumerate(shared_configurations(responses)):
        for axis, name in enumerate(responses[0].axis_names):
            traces: list[dict[str, Any]] = []
            for run, (label, frf, number) in enumerate(zip(labels, responses, numbers, strict=True)):
                valid = frf.valid_lines[number]
                value = frf.response[number, valid, axis, axis]
                common = {
                    "x": [round(f, 6) for f in frf.frequency_hz[valid].tolist()],
                    "name": label,
                    "type": "scatter",
                    "mode": "lines+markers",
                    "line": {"color": COLOURS[run % len(COLOURS)], "width": 1.2},
                    "marker": {"color": COLOURS[run % len(COLOURS)], "size": 3.4},
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
