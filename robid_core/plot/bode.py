"""Frequency responses: magnitude in dB over phase, entry by entry of the matrix, measured beside modelled.

A band of two standard deviations is drawn about what was measured, where they are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import Frf, ResponseComparison
from robid_core.plot.rounding import compact, resolved, rounded_to
from robid_core.plot.style import BAND, MEASURED, MODEL, START, Figure, axis, heading_over, layout, title
from robid_core.robot import Robot

FLOOR = 1e-12  # (rad/s^2)/(N m); an entry that is zero by symmetry would be at minus infinity dB
SPREAD = 2.0  # standard deviations on either side
FIRST_PHASE = 101  # number of the first phase axis; magnitude axes count from one
TICKS = [
    float(f"{m}e{e}") for e in range(-3, 4) for m in (1, 2, 5)
]  # what people read off one or two decades
TICK_TEXT = [f"{tick:.10g}" for tick in TICKS]

Entry = tuple[int, int, str]
"""Output, input, heading."""


def comparison_of(
    frf: Frf, model: ComplexArray, between: tuple[FloatArray, ComplexArray] | None = None
) -> ResponseComparison:
    """Return a measured response beside that of a robot to which nothing was fitted.

    `between` are frequencies that lie closer than the lines and the robot's response there.
    """
    frequency, curve = between or (None, None)
    deviation = np.sqrt(frf.variance()) if frf.has_covariance else np.full(frf.response.shape, np.nan)
    measured = np.where(frf.valid_lines[:, :, None, None], frf.response, np.nan)
    return ResponseComparison(
        axis_names=frf.axis_names,
        frequency_hz=frf.frequency_hz,
        measured=measured,
        modelled=model,
        start=model,
        deviation=deviation,
        curve_frequency_hz=frequency,
        curve=curve,
        curve_start=curve,
    )


def beside(frf: Frf, robot: Robot) -> ResponseComparison:
    """Return a measured response beside that of a robot, drawn between the lines, too.

    Friction damps as under the motion that was measured, where the response knows that.
    """
    between = ResponseComparison.frequencies_of_curves(frf.frequency_hz)
    damping = None
    if frf.speed_rms is not None and frf.slow_sine_speed is not None:
        damping = robot.equivalent_motor_damping(frf.speed_rms, frf.slow_sine_speed, frf.frequency_hz)
    model, curve = (
        robot.response(frf.angle, f, damping, hold=frf.torque_hold) for f in (frf.frequency_hz, between)
    )
    return comparison_of(frf, model, (between, curve))


def bode_data(
    comparison: ResponseComparison, configuration: int, entries: Sequence[Entry], fitted: bool
) -> list[dict[str, Any]]:
    """Return the traces of some entries in one configuration, for `bode_layout` of as many.

    Parameters
    ----------
    comparison
        Measured and modelled responses.
    configuration
        Counted from zero.
    entries
        Which entries, in the order of their places.
    fitted
        Whether `modelled` is a fit; otherwise only `start` is drawn, as the robot file's.
    """
    f = np.asarray(rounded_to(comparison.frequency_hz, 6), dtype=np.float64)
    fine, starts, models = _curves(comparison)
    traces = []
    for place, (out, into, _) in enumerate(entries):
        measured, start, model = (
            part[configuration, :, out, into] for part in (comparison.measured, starts, models)
        )
        deviation = comparison.deviation[configuration, :, out, into]
        number = "" if place == 0 else str(place + 1)
        magnitude = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        phase = {"xaxis": f"x{number}", "yaxis": f"y{place + FIRST_PHASE}"}
        traces += _band(f, np.abs(measured), SPREAD * deviation, magnitude)
        told = "start" if fitted else "robot file"
        for where, shown in ((magnitude, _decibel), (phase, _degrees)):
            line = _line(fine, shown(start), told, where)
            traces.append({**line, "line": {"color": START, "width": 1.1, "dash": "4px,3px"}})
            marker = {"color": MEASURED, "size": 3.6}
            traces.append(
                {**_trace(f, shown(measured), "measured", where), "mode": "markers", "marker": marker}
            )
            if fitted:
                line = _line(fine, shown(model), "fitted model", where)
                traces.append({**line, "line": {"color": MODEL, "width": 1.6, "dash": "solid"}})
    return traces


def bode_layout(entries: Sequence[Entry], columns: int, height: int) -> dict[str, Any]:
    """Return where each entry stands: so many columns, `height` pixels a row, magnitude above phase."""
    rows = -(-len(entries) // columns)
    gap_x, gap_y = (0.055 if columns > 1 else 0.0), (0.26 / rows if rows > 1 else 0.0)
    width, tall = (1 - gap_x * (columns - 1)) / columns, (1 - gap_y * (rows - 1)) / rows
    found = layout(height * rows, 46, 24, 36, annotations=[], hovermode="closest")
    for place, (_, _, heading) in enumerate(entries):
        row, column = divmod(place, columns)
        number = "" if place == 0 else str(place + 1)
        left, bottom = column * (width + gap_x), 1 - (row + 1) * tall - row * gap_y
        split, first = bottom + 0.38 * tall, column == 0
        under = {"title": title("Hz")} if row == rows - 1 else {}
        ticks = {"tickvals": TICKS, "ticktext": TICK_TEXT}
        found[f"xaxis{number}"] = axis(
            type="log", domain=_span(left, left + width), anchor=f"y{place + FIRST_PHASE}", **ticks, **under
        )
        found[f"yaxis{number}"] = axis(
            domain=_span(split + 0.03 * tall, bottom + tall),
            anchor=f"x{number}",
            nticks=6,
            **({"title": title("dB", 2)} if first else {}),
        )
        found[f"yaxis{place + FIRST_PHASE}"] = axis(
            domain=_span(bottom, split - 0.03 * tall),
            anchor=f"x{number}",
            range=[-190, 190],
            tickvals=[-180, 0, 180],
            **({"title": title("deg", 2)} if first else {}),
        )
        if heading:
            found["annotations"].append(heading_over(heading, round(left, 4), round(bottom + tall, 4)))
    return found


def bode(
    comparison: ResponseComparison,
    configuration: int,
    entries: Sequence[Entry],
    fitted: bool,
    columns: int,
    height: int,
) -> Figure:
    """Return the figure of some entries in one configuration."""
    data = bode_data(comparison, configuration, entries, fitted)
    return {"data": data, "layout": bode_layout(entries, columns, height)}


def _curves(comparison: ResponseComparison) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Return frequencies, start and model as they are drawn: between the lines where they are known there."""
    f, start, model = comparison.curve_frequency_hz, comparison.curve_start, comparison.curve
    if f is None or start is None or model is None:
        f, start, model = comparison.frequency_hz, comparison.start, comparison.modelled
    return np.asarray(rounded_to(f, 6), dtype=np.float64), start, model


def _span(low: float, high: float) -> list[float]:
    return [round(max(low, 0.0), 4), round(min(high, 1.0), 4)]


def _decibel(values: ComplexArray | FloatArray) -> FloatArray:
    result: FloatArray = 20 * np.log10(np.maximum(np.abs(values), FLOOR))
    return result


def _degrees(values: ComplexArray) -> FloatArray:
    result: FloatArray = np.degrees(np.angle(values))
    return result


def _trace(x: FloatArray, y: FloatArray, name: str, where: dict[str, str]) -> dict[str, Any]:
    hover = "%{x:.3g} Hz, %{y:.2f}<extra>" + name + "</extra>"
    return {"x": compact(x, 9), "y": resolved(y, 2), "name": name, "hovertemplate": hover, **where}


def _line(f: FloatArray, y: FloatArray, name: str, where: dict[str, str]) -> dict[str, Any]:
    """Return a line that is broken where a phase passes 180 degrees, and not drawn across the plot."""
    jumps = np.flatnonzero(np.abs(np.diff(y)) > 180) + 1
    x, y = np.insert(f, jumps, f[jumps]), np.insert(y, jumps, np.nan)
    return {**_trace(x, y, name, where), "mode": "lines"}


def _band(f: FloatArray, size: FloatArray, spread: FloatArray, where: dict[str, str]) -> list[dict[str, Any]]:
    """Return the band about a magnitude; none where no deviation is known."""
    known = np.isfinite(spread) & np.isfinite(size)
    if not known.any():
        return []
    f, size, spread = f[known], size[known], spread[known]
    low = np.maximum(size - spread, 0.03 * size)  # below the measurement's own 3 % it would fall off the plot
    around = np.concatenate((_decibel(low), _decibel(size + spread)[::-1]))
    return [
        {
            "x": compact(np.concatenate((f, f[::-1])), 9),
            "y": resolved(around, 2),
            "mode": "lines",
            "fill": "toself",
            "fillcolor": BAND,
            "line": {"width": 0},
            "hoverinfo": "skip",
            "name": "two standard deviations",
            **where,
        }
    ]
