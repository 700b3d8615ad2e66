"""How far each method is from the best linear approximation: ranking, bands, and error against experiment time.

From the rows of accuracy.csv. Errors are root mean squares of ``|log G - log G_BLA|``, here in percent (a hundredth of
a neper, or of a radian).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import plotly.graph_objects as go

from studies.frf_methods.figures_style import (
    FAMILIES,
    INK,
    MARKERS,
    SHADES,
    Row,
    colour,
    family,
    in_legend,
    interval,
    label,
    laid_out,
    number,
    plain_ticks,
    rows_of_methods,
)
from studies.frf_methods.methods import METHODS, PUBLISHED

JUDGE = METHODS["log"].title
MOST = 24  # experiments of the judge
TARGET = 1.1  # times the error of the judge, from six experiments
EXPERIMENTS, TIMED = (1, 2, 3, 6, 12, 24), (1, 6, 24)
PLOT_PIXELS = 360  # height between the axes, whatever stands below
PARTS = {"error": "circle", "bias": "line-ns-open", "scatter": "circle-open"}
BANDS = {"4_8_hz": "triangle-down", "8_25_hz": "circle", "25_80_hz": "triangle-up"}
QUANTITY = "root mean square of log G − log G<sub>BLA</sub>, %"

Curve = list[tuple[float, float]]
"""(experiments, error in percent), by experiments."""


def with_experiments(rows: Sequence[Row], count: int) -> list[Row]:
    """Rows of so many experiments, the best first."""
    found = [row for row in rows if number(row, "experiments") == count and number(row, "error") > 0]
    return sorted(found, key=lambda row: number(row, "error"))


def with_published_place(title: str) -> str:
    """A method's title with its place in the published ranking; LOG and harmonic share the first."""
    places = {METHODS[key].title: max(1, i) for i, key in enumerate(PUBLISHED)}
    return f"{label(title)} <b>({places[title]})</b>" if title in places else label(title)


def ranking(rows: Sequence[Row], count: int = MOST) -> go.Figure:
    """Error with interval, bias and scatter of every method, the best at the top."""
    shown = with_experiments(rows, count)[::-1]
    figure = go.Figure()
    seen = []
    for i, row in enumerate(shown):
        tone = colour(row["method"])
        for key in ("bias", "scatter", "error"):
            value = 100 * number(row, key)
            if not value > 0:
                continue
            seen.append(value)
            whole = key == "error"
            bars = (
                interval(value, 100 * number(row, "low"), 100 * number(row, "high"), tone) if whole else None
            )
            marker = {
                "color": tone, "size": 10 if whole else 9, "symbol": PARTS[key], "line": {"width": 0 if whole else 2}
            }  # fmt: skip
            hover = f"{key} %{{x:.3g}} %<extra>{row['method']}</extra>"
            figure.add_scatter(
                x=[value],
                y=[i],
                error_x=bars,
                mode="markers",
                marker=marker,
                showlegend=False,
                hovertemplate=hover,
            )
    for name, symbol in PARTS.items():
        words = "error, with its 95 % interval" if name == "error" else name
        in_legend(figure, words, symbol)
    figure.update_xaxes(title_text=QUANTITY, **plain_ticks(seen))
    return rows_of_methods(figure, [with_published_place(row["method"]) for row in shown])


def by_band(rows: Sequence[Row], count: int = MOST) -> go.Figure:
    """Error of every method in three bands, in the order of the ranking."""
    shown = with_experiments(rows, count)[::-1]
    tones = [colour(row["method"]) for row in shown]
    figure = go.Figure()
    seen = []
    for key, symbol in BANDS.items():
        values = [100 * number(row, f"error_{key}") for row in shown]
        seen += values
        name = key.replace("_hz", " Hz").replace("_", "–")
        figure.add_scatter(
            x=[value if value > 0 else None for value in values],
            y=list(range(len(values))),
            mode="markers",
            marker={"color": tones, "size": 9, "symbol": symbol},
            showlegend=False,
            hovertemplate=f"{name}: %{{x:.3g}} %<extra></extra>",
        )
        in_legend(figure, name, symbol)
    figure.update_xaxes(title_text="root mean square error in the band, %", **plain_ticks(seen))
    return rows_of_methods(figure, [label(row["method"]) for row in shown])


# Against the number of experiments -----------------------------------------------------------------------------


def curves(rows: Sequence[Row], value: str = "error") -> dict[str, Curve]:
    """Error of each method against its number of experiments; `value` is the column."""
    found: dict[str, Curve] = {}
    for row in rows:
        point = number(row, "experiments"), 100 * number(row, value)
        if all(math.isfinite(one) and one > 0 for one in point):
            found.setdefault(row["method"], []).append(point)
    return {title: sorted(points) for title, points in found.items()}


def efficiency(rows: Sequence[Row], name: str, seconds: float | None) -> go.Figure:
    """Error of one family's methods against experiments, with the level of LOG from 24 and 1.1 times that.

    `seconds` is what one experiment takes, with the period in which it settles. All families have the same axes.
    """
    everything = curves(rows)
    figure = go.Figure()
    mine = [title for title in everything if family(title) == name]
    for i, title in enumerate(mine):
        points, tone = everything[title], SHADES[name][i % len(SHADES[name])]
        figure.add_scatter(
            x=[x for x, _ in points],
            y=[y for _, y in points],
            name=title,
            mode="lines+markers",
            line={"color": tone, "width": 1.8},
            marker={"color": tone, "size": 8, "symbol": MARKERS[i % len(MARKERS)]},
            hovertemplate="%{x} experiments: %{y:.3g} %<extra>" + title + "</extra>",
        )
    errors = [y for points in everything.values() for _, y in points]
    level = dict(everything.get(JUDGE, [])).get(MOST)
    if level is not None:
        for factor, dash in ((1.0, "dash"), (TARGET, "dot")):
            figure.add_hline(y=factor * level, line={"color": INK, "width": 1.2, "dash": dash})
        figure.add_annotation(
            x=0, xref="paper", xanchor="left", y=math.log10(level), yanchor="top", showarrow=False,
            text=f"{JUDGE}, {MOST} experiments", font={"size": 11.5, "color": INK}, bgcolor="rgba(255,255,255,.8)",
        )  # fmt: skip
    timed = [f"{x}<br>{duration(x * seconds)}" if seconds and x in TIMED else f"{x}" for x in EXPERIMENTS]
    figure.update_xaxes(
        type="log",
        range=[math.log10(0.8), math.log10(30)],
        tickvals=EXPERIMENTS,
        ticktext=timed,
        tickangle=0,
        title_text="experiments" + (", and their time" if seconds else ""),
    )
    figure.update_yaxes(title_text="error, %", **plain_ticks(errors))
    below = 64 + 20 * len(mine)
    legend = {"orientation": "v", "x": 0, "y": -64 / PLOT_PIXELS, "yanchor": "top", "font": {"size": 12}}
    margin = {"l": 56, "r": 12, "t": 12, "b": below}
    return laid_out(figure, PLOT_PIXELS + 12 + below, legend=legend, margin=margin)


def efficiency_figures(rows: Sequence[Row], seconds: float | None) -> dict[str, go.Figure]:
    """One figure for each family that has methods."""
    present = {family(title) for title in curves(rows)}
    return {f"efficiency-{name}": efficiency(rows, name, seconds) for name in FAMILIES if name in present}


def duration(seconds: float) -> str:
    """Seconds or minutes, short."""
    return f"{seconds:.3g} s" if seconds < 60 else f"{seconds / 60:.2g} min"
