"""The same robots otherwise, and resonances over the amplitude; from the rows of variants.csv and amplitude.csv."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from studies.frf_methods import figures_accuracy, variants
from studies.frf_methods.figures_style import (
    EVEN,
    FITS,
    INK,
    ODD,
    SOFT,
    USED,
    Row,
    in_legend,
    interval,
    label,
    laid_out,
    number,
    plain_ticks,
    rows_of_methods,
)

SYMBOLS = {"shipped": ("circle", INK), "dense": ("diamond", ODD), "more": ("triangle-up", FITS["scalar"])}
SPRINGS = {"linear springs": EVEN, "stiffening gears": USED}
FOLLOWED = {"resonance_hz": ("resonance", "solid"), "antiresonance_hz": ("antiresonance", "dot")}


def of_variant(rows: Sequence[Row], key: str) -> list[Row]:
    """Rows of one variant."""
    return [row for row in rows if row.get("variant") == variants.SETTINGS[key].title]


def without_friction(rows: Sequence[Row]) -> go.Figure | None:
    """Ranking with 24 experiments of robots without friction and ripple."""
    smooth = of_variant(rows, "smooth")
    return figures_accuracy.ranking(smooth) if figures_accuracy.with_experiments(smooth, 24) else None


def other_excitations(rows: Sequence[Row]) -> go.Figure | None:
    """Errors of the methods by the way they were excited, a row for each number of blocks."""
    found: dict[tuple[str, str], list[tuple[str, Row]]] = {}
    for key in SYMBOLS:
        for row in of_variant(rows, key):
            count = {"7": "6 or 7", "6": "6 or 7", "28": "24 or 28", "24": "24 or 28"}.get(
                row["experiments"], "1"
            )
            found.setdefault((row["method"], count), []).append((key, row))
    shown = {place: points for place, points in found.items() if len(points) > 1}
    if not shown:
        return None
    figure, seen = go.Figure(), []
    order = sorted(shown, key=lambda place: -number(shown[place][0][1], "error"))
    for i, place in enumerate(order):
        for key, row in shown[place]:
            symbol, tone = SYMBOLS[key]
            value, low, high = (100 * number(row, name) for name in ("error", "low", "high"))
            seen.append(value)
            figure.add_scatter(
                x=[value],
                y=[i],
                error_x=interval(value, low, high, tone),
                mode="markers",
                marker={"color": tone, "size": 9, "symbol": symbol},
                showlegend=False,
                hovertemplate=f"%{{x:.3g}} %<extra>{variants.SETTINGS[key].title}</extra>",
            )
    for key, (symbol, _) in SYMBOLS.items():
        in_legend(figure, variants.SETTINGS[key].title, symbol)
    figure.update_xaxes(title_text=figures_accuracy.QUANTITY, **plain_ticks(seen))
    return rows_of_methods(figure, [f"{label(method)} · {count}" for method, count in order])


def amplitude(rows: Sequence[Row]) -> go.Figure | None:
    """Resonance and antiresonance of each axis over the amplitude, against those of linear springs at the strongest."""
    axes = list(dict.fromkeys(row["axis"] for row in rows if row.get("axis")))
    if not axes:
        return None
    figure = make_subplots(1, len(axes), shared_yaxes=True, subplot_titles=axes, horizontal_spacing=0.03)
    for column, axis in enumerate(axes, start=1):
        mine = [row for row in rows if row.get("axis") == axis]
        for key, (name, dash) in FOLLOWED.items():
            linear = [row for row in mine if row["springs"] == "linear springs"]
            strongest = max(linear, key=lambda row: number(row, "torque_share"))
            for springs, tone in SPRINGS.items():
                points = sorted(
                    (number(row, "torque_share"), 100 * (number(row, key) / number(strongest, key) - 1))
                    for row in mine
                    if row["springs"] == springs
                )
                figure.add_scatter(
                    x=[100 * x for x, _ in points],
                    y=[y for _, y in points],
                    name=f"{name}, {springs}",
                    mode="lines+markers",
                    line={"color": tone, "dash": dash},
                    showlegend=column == 1,
                    hovertemplate="%{x:g} % of the limit: %{y:.2f} %<extra>" + name + "</extra>",
                    row=1,
                    col=column,
                )
    shares = [100 * number(row, "torque_share") for row in rows]
    figure.update_xaxes(title_text="peak torque of the multisine, % of the limit", **plain_ticks(shares))
    figure.add_hline(y=0, line={"color": SOFT, "width": 1})
    figure.update_yaxes(title_text="shift, %", col=1)
    laid_out(figure, 380, margin={"l": 56, "r": 12, "t": 70, "b": 52})
    return figure.update_layout(legend={"y": 1.12})
