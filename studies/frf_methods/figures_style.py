"""How the study's figures look: one typeface, one colour a family of methods, plain numbers on logarithmic axes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import plotly.graph_objects as go

from studies.frf_methods.methods import METHODS

INK, SOFT, GRID = "#1d2731", "#5b6874", "#e4e8ec"
USED, UNUSED, ODD, EVEN = "#c0392b", "#93a4b5", "#2f7fb5", "#b0bac3"
FAMILIES = {
    "averaging": ("average over blocks or segments", "#34567f"),
    "local": ("local model", "#1b8a5a"),
    "compensated": ("after compensation of the record", "#c8641b"),
}
SHADES = {
    "averaging": ("#1f3a5f", "#4f86c6", "#7a5195", "#2a9d9d", "#6b7b8c", "#a05195"),
    "local": ("#1b8a5a", "#0b4f3a", "#7fb069", "#2a9d9d", "#a3b018", "#5c7457"),
    "compensated": ("#c8641b", "#8c2f0f", "#e0a030", "#c44569", "#7d5a3c", "#f08a5d"),
}
MARKERS = ("circle", "square", "diamond", "triangle-up", "x", "triangle-down", "hexagon", "star", "cross")
FITS = {"scalar": "#c99700", "miso": "#2f7fb5", "mimo": "#1b8a5a"}
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"
CONFIG: dict[str, Any] = {"responsive": True, "displaylogo": False, "displayModeBar": False}
ROW_PIXELS = 26
LONG_LABEL = 26  # characters; a longer label is broken at its comma

Row = Mapping[str, str]


def family(title: str) -> str:
    """Family of a method by its title in the tables."""
    method = next((method for method in METHODS.values() if method.title == title), None)
    if "removed" in title or (method is not None and method.before):
        return "compensated"
    local = method.use in ("frf.lrm", "frf.lpm") if method is not None else title.startswith(("LRM", "LPM"))
    return "local" if local else "averaging"


def colour(title: str) -> str:
    """Colour of a method's family."""
    return FAMILIES[family(title)][1]


def number(row: Row, key: str) -> float:
    """Entry of a table as a number; NaN where there is none."""
    try:
        return float(row.get(key) or "nan")
    except ValueError:
        return float("nan")


def label(title: str) -> str:
    """Title of a method as it stands beside an axis, long ones in two lines."""
    return title.replace(", ", ",<br>", 1) if len(title) > LONG_LABEL else title


def interval(middle: float, low: float, high: float, tone: str) -> dict[str, Any] | None:
    """Error bar from `low` to `high`; None where they are no interval about the middle."""
    if not low <= middle <= high:
        return None
    arms = {"array": [high - middle], "arrayminus": [middle - low]}
    return {"type": "data", "symmetric": False, **arms, "color": tone, "thickness": 2, "width": 0}


def laid_out(figure: go.Figure, height: int, **layout: Any) -> go.Figure:
    """Give a figure the page's look."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        font={"family": FONT, "size": 13, "color": INK},
        margin={"l": 64, "r": 18, "t": 34, "b": 52},
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "font": {"size": 12.5}},
        hoverlabel={"font": {"family": FONT, "size": 12.5}},
    )
    figure.update_xaxes(gridcolor=GRID, zeroline=False, linecolor="#9aa7b4", title_standoff=8)
    figure.update_yaxes(gridcolor=GRID, zeroline=False, title_standoff=8)
    return figure.update_layout(**layout)


def rows_of_methods(figure: go.Figure, labels: Sequence[str]) -> go.Figure:
    """A figure with a row for each label, the first at the bottom, at the heights 0, 1, ..."""
    figure.update_yaxes(
        tickvals=list(range(len(labels))),
        ticktext=list(labels),
        tickfont={"size": 12.5},
        automargin=True,
        range=[-0.7, len(labels) - 0.3],
    )
    height = 130 + (ROW_PIXELS + 12 * any("<br>" in one for one in labels)) * len(labels)
    return laid_out(figure, height, margin={"l": 10, "r": 18, "t": 60, "b": 52})


def in_legend(figure: go.Figure, name: str, symbol: str) -> None:
    """Entry of the legend that stands for a sort of marker in every colour."""
    marker = {"color": SOFT, "size": 9, "symbol": symbol, "line": {"width": 2 if "open" in symbol else 0}}
    figure.add_scatter(x=[None], y=[None], name=name, mode="markers", marker=marker)


def plain_ticks(values: Sequence[float], room: float = 0.06) -> dict[str, Any]:
    """Logarithmic axis over positive values with numbers in full: 0.5, 1, 2, 5, 10.

    `room` is left free at either end, in decades.
    """
    positive = [value for value in values if math.isfinite(value) and value > 0] or [1.0]
    low, high = math.log10(min(positive)) - room, math.log10(max(positive)) + room
    digits = (1, 2, 5) if high - low < 2.2 else (1, 3) if high - low < 3.2 else (1,)
    ticks = [digit * 10.0**decade for decade in range(-9, 10) for digit in digits]
    ticks = [tick for tick in ticks if low <= math.log10(tick) <= high]
    words = [f"{tick:.6g}" for tick in ticks]
    return {"type": "log", "range": [low, high], "tickvals": ticks, "ticktext": words}


def dashed_at(
    figure: go.Figure, x: float, words: str, tone: str, dash: str = "dash", raised: int = 0
) -> None:
    """Vertical line over the whole height of a logarithmic axis, with words above it."""
    figure.add_vline(x=x, line={"color": tone, "width": 1.3, "dash": dash})
    figure.add_annotation(
        x=math.log10(x), y=1, yref="paper", yanchor="bottom", yshift=raised, text=words, showarrow=False,
        font={"size": 12, "color": tone},
    )  # fmt: skip
