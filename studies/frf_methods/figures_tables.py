"""What the responses are worth, from the CSV tables: stiffness errors, and whether regions hold what they say."""

from __future__ import annotations

import math
from collections.abc import Sequence

import plotly.graph_objects as go

from studies.frf_methods.figures_style import (
    INK,
    SOFT,
    Row,
    colour,
    dashed_at,
    in_legend,
    interval,
    label,
    number,
    plain_ticks,
    rows_of_methods,
)

PROMISED = (0.92, 0.98)  # of the estimator's own mean
LEVELS = ("floor", "bound")
FAR = "noise alone"  # two decades below everything else: in the table only
HELD = (
    ("own_mean", "own_low", "own_high", "the method's own mean", "circle", 0.15),
    ("g_bla", "g_bla_low", "g_bla_high", "G<sub>BLA</sub>", "diamond-open", -0.15),
)


def is_level(row: Row) -> bool:
    """Tell whether a row is no method but what methods are held against."""
    return any(word in row.get("method", "").lower() for word in LEVELS)


def variant(row: Row) -> str:
    """Label of a method with its number of experiments, where the table has one."""
    count = row.get("experiments")
    return label(row["method"]) + (f" · {count}" if count else "")


def stiffness(rows: Sequence[Row]) -> go.Figure | None:
    """Root mean square relative errors with intervals, the best at the top; floor and bounds as lines."""
    found = [row for row in rows if number(row, "rms_error") > 0]
    methods = sorted((row for row in found if not is_level(row)), key=lambda row: -number(row, "rms_error"))
    if not methods:
        return None
    figure = go.Figure()
    for i, row in enumerate(methods):
        middle, low, high = (100 * number(row, key) for key in ("rms_error", "low", "high"))
        tone = colour(row["method"])
        figure.add_scatter(
            x=[middle],
            y=[i],
            error_x=interval(middle, low, high, tone),
            mode="markers",
            marker={"color": tone, "size": 10},
            showlegend=False,
            hovertemplate="%{x:.3g} %<extra>" + variant(row) + "</extra>",
        )
    levels = [row for row in found if is_level(row) and FAR not in row["method"]]
    for i, row in enumerate(levels):
        tone, dash = (INK, "dash") if i == 0 else (SOFT, "dot")
        words = row["method"] if i == 0 else f"{row['method']}, experiments: {row.get('experiments')}"
        dashed_at(figure, 100 * number(row, "rms_error"), words, tone, dash, raised=16 * i)
    seen = [100 * number(row, key) for row in [*methods, *levels] for key in ("rms_error", "low", "high")]
    figure.update_xaxes(
        title_text="root mean square relative error of the stiffnesses, %", **plain_ticks(seen)
    )
    rows_of_methods(figure, [variant(row) for row in methods])
    return figure.update_layout(margin_t=30 + 18 * len(levels))


def coverage(rows: Sequence[Row]) -> go.Figure | None:
    """Share of 95 % regions that hold the method's own mean, and G_BLA, with intervals."""
    shown = [row for row in rows if math.isfinite(number(row, "own_mean"))][::-1]
    if not shown:
        return None
    figure = go.Figure()
    seen = [100 * PROMISED[0]]
    for key, low_key, high_key, name, symbol, shift in HELD:
        for i, row in enumerate(shown):
            value, low, high = (100 * number(row, k) for k in (key, low_key, high_key))
            if not math.isfinite(value):
                continue
            tone = colour(row["method"])
            seen += [value, low] if math.isfinite(low) else [value]
            figure.add_scatter(
                x=[value],
                y=[i + shift],
                error_x=interval(value, low, high, tone),
                mode="markers",
                marker={
                    "color": tone,
                    "size": 9,
                    "symbol": symbol,
                    "line": {"width": 2 * ("open" in symbol)},
                },
                showlegend=False,
                hovertemplate=f"%{{x:.1f}} % hold {name}<extra>{variant(row)}</extra>",
            )
        in_legend(figure, name, symbol)
    figure.add_vrect(
        x0=100 * PROMISED[0], x1=100 * PROMISED[1], fillcolor="#dcebe1", line_width=0, layer="below"
    )
    figure.add_vline(x=95, line={"color": SOFT, "width": 1, "dash": "dash"})
    figure.update_xaxes(title_text="regions that hold it, %", range=[min(seen) - 2, 100.5])
    return rows_of_methods(figure, [variant(row) for row in shown])


def region_sizes(rows: Sequence[Row]) -> go.Figure | None:
    """Median radius of a region over the size of the entry, in the order of the coverage."""
    shown = [row for row in rows if number(row, "size") > 0][::-1]
    if not shown:
        return None
    figure = go.Figure()
    values = [100 * number(row, "size") for row in shown]
    figure.add_scatter(
        x=values,
        y=list(range(len(shown))),
        mode="markers",
        marker={"color": [colour(row["method"]) for row in shown], "size": 9},
        showlegend=False,
        hovertemplate="%{x:.3g} %<extra></extra>",
    )
    figure.update_xaxes(title_text="median radius of a region, % of the entry", **plain_ticks(values))
    return rows_of_methods(figure, [variant(row) for row in shown])
