"""Dots and lines over one variable: friction over speed, what a model leaves over all that it may depend on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import FrictionCurve, ResidualCurve
from robid_core.plot.rounding import rounded_to
from robid_core.plot.style import MEASURED, MODEL, START, Figure, axis, heading_over, layout, title

Curve = tuple[str, str, str, FloatArray, FloatArray, Mapping[str, FloatArray]]
"""Heading, variable, unit, abscissa, dots, lines by name."""


def friction_curves(curves: Sequence[FrictionCurve]) -> list[Curve]:
    """Return the friction of each axis over its speed: as measured, and the law."""
    return [
        (
            f"{one.axis}: {one.law}",
            f"motor speed, {one.speed_unit}",
            one.unit_symbol,
            one.speed,
            one.measured,
            {"law": one.fitted},
        )
        for one in curves
    ]


def residual_curves(curves: Sequence[ResidualCurve]) -> list[Curve]:
    """Return what is left of the torque: dots by the refitted robot, a line by the robot that was found."""
    found: list[Curve] = []
    for one in curves:
        lines = (
            {"found": one.extended}
            if one.measured is None
            else {"torque": one.measured, "found": one.extended}
        )
        found.append((one.axis, one.variable, one.unit_symbol, one.abscissa, one.refitted, lines))
    return found


def side_by_side(curves: Sequence[Curve], columns: int = 2, height: int = 260) -> Figure:
    """Return one figure of several curves, in rows of `columns`."""
    columns = min(columns, len(curves))
    rows = -(-len(curves) // columns)
    gap_x, gap_y = 0.1, 0.3 / rows if rows > 1 else 0.0
    width, tall = (1 - gap_x * (columns - 1)) / columns, (1 - gap_y * (rows - 1)) / rows
    figure: Figure = {"data": [], "layout": layout(height * rows, 60, 24, 40, annotations=[])}
    for place, (heading, variable, unit, x, dots, lines) in enumerate(curves):
        row, column = divmod(place, columns)
        number = "" if place == 0 else str(place + 1)
        left, bottom = column * (width + gap_x), 1 - (row + 1) * tall - row * gap_y
        where = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        shown = rounded_to(x, 6)
        figure["data"].append(
            {
                "x": shown,
                "y": rounded_to(dots, 5),
                "mode": "markers",
                "name": "data",
                "marker": {"color": MEASURED, "size": 5},
                **where,
            }
        )
        order = np.argsort(x, kind="stable")
        for name, values in lines.items():
            line = {"color": START if name == "torque" else MODEL, "width": 1.6}
            drawn = {"x": rounded_to(x[order], 6), "y": rounded_to(values[order], 5)}
            figure["data"].append({**drawn, "mode": "lines", "name": name, "line": line, **where})
        logarithmic = "log" if variable.startswith("frequency") else "linear"
        span = [round(left, 4), round(min(left + width, 1.0), 4)]
        figure["layout"][f"xaxis{number}"] = axis(
            domain=span, anchor=f"y{number}", type=logarithmic, title=title(variable)
        )
        figure["layout"][f"yaxis{number}"] = axis(
            domain=[round(max(bottom, 0.0), 4), round(bottom + tall, 4)],
            anchor=f"x{number}",
            title=title(unit),
        )
        figure["layout"]["annotations"].append(heading_over(heading, span[0], round(bottom + tall, 4)))
    return figure
