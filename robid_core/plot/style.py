"""How figures look: colours, fonts and axes, the same on the page and in a notebook."""

from __future__ import annotations

from html import escape
from typing import Any

INK, SOFT, LINE, TICK = "#1d2733", "#5b6875", "#e6eaef", "#b9c3cd"
MEASURED, BAND, MODEL = "#24476b", "rgba(36,71,107,0.16)", "#c8501e"
START, RESIDUAL = "#9aa7b4", "#4f7f6a"
DARK = {
    INK: "#e6ebf0",
    SOFT: "#a9b5c1",
    LINE: "#2b3641",
    TICK: "#4a5865",
    MEASURED: "#8dbcec",
    BAND: "rgba(141,188,236,0.2)",
    MODEL: "#ff9364",
    START: "#8593a1",
    RESIDUAL: "#7fc4a4",
}
"""What stands for each colour on a dark ground."""
FAMILY = 'ui-sans-serif, system-ui, -apple-system, "Segoe UI", Roboto, Arial, sans-serif'

Figure = dict[str, Any]
"""`data` and `layout` of a Plotly figure, as plain values that JSON can hold."""


def axis(**extra: Any) -> dict[str, Any]:
    """Return an axis with its own settings."""
    plain = {"gridcolor": LINE, "zeroline": False, "linecolor": TICK, "ticks": "outside", "ticklen": 3}
    return {**plain, "tickcolor": TICK, "automargin": True, **extra}


def title(text: str, standoff: int = 4) -> dict[str, Any]:
    """Return the title of an axis."""
    return {"text": plain(text), "standoff": standoff}


def heading_over(text: str, left: float, bottom: float) -> dict[str, Any]:
    """Return a heading as an annotation of a figure, above a place in shares of its width and height."""
    return {
        "text": plain(text),
        "x": left,
        "y": bottom,
        "xref": "paper",
        "yref": "paper",
        "xanchor": "left",
        "yanchor": "bottom",
        "showarrow": False,
        "font": {"size": 13, "color": INK},
    }


def layout(height: int, left: int, top: int, bottom: int, **extra: Any) -> dict[str, Any]:
    """Return a layout without a legend, with margins in pixels."""
    return {
        "height": height,
        "margin": {"l": left, "r": 8, "t": top, "b": bottom},
        "font": {"family": FAMILY, "size": 12, "color": SOFT},
        "showlegend": False,
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": TICK, "activecolor": SOFT},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        **extra,
    }


def plain(text: str) -> str:
    """Return text as a label shows it: Plotly reads a little HTML in labels, and names are shown as they are."""
    return escape(text, quote=False)


def columns_of(n: int) -> int:
    """Return in how many columns the panels of `n` axes stand."""
    return 1 if n == 1 else 2 if n <= 4 else 3


def shown(figure: Figure) -> Any:
    """Return a Plotly figure of plain values."""
    import plotly.graph_objects  # slow to import

    return plotly.graph_objects.Figure(figure)
