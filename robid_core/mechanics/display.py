"""Simulations and linear models as a notebook shows them: a line of text, a table of HTML; their arrays stay folded."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from robid_core.arrays import FloatArray

MOST_ROWS = 30


def simulation_text(position: FloatArray, saturated: FloatArray) -> str:
    """Say how much was simulated: position (n_lane, n_sample, n_axis), share at the limit (n_lane, n_axis)."""
    n_lane, n_sample, n_axis = position.shape
    limit = (
        f"; at the torque limit {100 * saturated.max():.2g} % of the time at most" if saturated.any() else ""
    )
    return f"Simulation: {n_lane} lanes, {n_sample} samples, {n_axis} axes{limit}"


def simulation_html(position: FloatArray, torque: FloatArray, saturated: FloatArray) -> str:
    """Return for each lane and axis how far it went, with which torque, and how long at its limit."""
    n_lane, _, n_axis = position.shape
    rows = []
    for lane, axis in np.ndindex(n_lane, n_axis):
        angle, applied = position[lane, :, axis], torque[lane, :, axis]
        went = f"{angle.min():.4g} to {angle.max():.4g}"
        rms = f"{np.sqrt(np.mean(applied**2)):.3g}"
        rows.append((str(lane), str(axis), went, rms, f"{100 * saturated[lane, axis]:.2g} %"))
    head = ("lane", "axis", "motor angle, rad", "torque (rms), N m", "at the torque limit")
    return f"<div>{escape(simulation_text(position, saturated))}{_table(head, rows)}</div>"


def model_html(
    resonances: tuple[FloatArray, FloatArray],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    states: tuple[str, ...],
) -> str:
    """Return frequencies in Hz and damping ratios of a linear model, and its names folded."""
    rows = [(f"{hz:.4g}", f"{100 * ratio:.2g} %") for hz, ratio in zip(*resonances, strict=True)]
    named = (("inputs", inputs), ("outputs", outputs), ("states", states))
    names = "".join(f"<p>{kind}: {escape(', '.join(them))}</p>" for kind, them in named)
    head = f"<b>LinearModel</b> {len(states)} states, {len(inputs)} inputs, {len(outputs)} outputs"
    table = _table(("resonance, Hz", "damping ratio"), rows)
    return f"<div>{head}{table}<details><summary>names</summary>{names}</details></div>"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    titles = "".join(f"<th>{escape(title)}</th>" for title in head)
    shown = rows[:MOST_ROWS]
    cells = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in shown)
    more = f"<p>{len(rows) - MOST_ROWS} more rows</p>" if len(rows) > MOST_ROWS else ""
    return f"<table><thead><tr>{titles}</tr></thead><tbody>{cells}</tbody></table>{more}"
