"""The study as one page: what each rung is off by, in time and in frequency."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import plotly.io
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from plotly.subplots import make_subplots

from studies.model_ladder.frequency import Responses
from studies.model_ladder.tracking import Tracking

COLOURS = {
    "rigid": "#b2182b",
    "flexible joint": "#e08214",
    "extended": "#4393c3",
    "Flex-Model": "#1b7837",
    "measured": "#222222",
}
SHOWN = ((0, 0), (1, 1), (2, 2), (4, 4))  # motor responses: output, input
TOOL_SHOWN = ((1, 0), (2, 1), (2, 2), (2, 4))  # tool responses: direction, input


def write_page(
    path: Path,
    tracked: list[dict[str, Any]],
    errors: list[dict[str, Any]],
    resonances: list[dict[str, Any]],
    runs: dict[str, Tracking],
    responses: dict[str, dict[str, Responses]],
) -> Path:
    """Write one self-contained HTML file; equal inputs give equal bytes."""
    figures = [tracking_figure(runs), *(response_figure(pose, rows) for pose, rows in responses.items())]
    parts = []
    for number, figure in enumerate(figures):
        html = plotly.io.to_html(
            figure, full_html=False, include_plotlyjs=number == 0, div_id=f"figure-{number}"
        )
        parts.append(Markup(html))  # numbers and fixed words only
    template = (Path(__file__).parent / "page.html.j2").read_text(encoding="utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["number"] = lambda value: f"{value:.3g}" if isinstance(value, float) else value
    tables = [
        ("In time: computed torque of each model on the plant", tracked),
        ("In frequency: median relative error of the responses", errors),
        ("Resonances, Hz", resonances),
    ]
    text = environment.from_string(template).render(
        tables=[(title, list(dict.fromkeys(k for row in rows for k in row)), rows) for title, rows in tables],
        figures=parts,
    )
    path.write_text(text, encoding="utf-8")
    return path


def tracking_figure(runs: dict[str, Tracking]) -> go.Figure:
    """Distance of the tool from its wanted place, and error of the motors of axes 1 and 2, over time."""
    figure = make_subplots(
        rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.04,
        subplot_titles=("tool, mm", "motor 1 at the joint, mrad", "motor 2 at the joint, mrad"),
    )  # fmt: skip
    for name, run in runs.items():
        lines = (np.linalg.norm(run.tool_error, axis=1), run.motor_error[:, 0], run.motor_error[:, 1])
        for row, values in enumerate(lines, start=1):
            _line(figure, row, 1, name, run.time_s[::4], 1e3 * values[::4], legend=row == 1)
    figure.update_xaxes(title_text="time, s", row=3, col=1)
    figure.update_layout(
        height=760, title="Fastest motion, plant with all its effects", template="plotly_white"
    )
    return figure


def response_figure(pose: str, responses: dict[str, Responses]) -> go.Figure:
    """Magnitudes of some entries of both responses at one pose."""
    titles = [f"motor {i + 1} by torque {j + 1}" for i, j in SHOWN]
    titles += [f"tool {'xyz'[i]} by torque {j + 1}" for i, j in TOOL_SHOWN]
    figure = make_subplots(
        rows=2, cols=4, subplot_titles=titles, horizontal_spacing=0.05, vertical_spacing=0.12
    )
    for name, found in responses.items():
        for row, (entries, values) in enumerate(((SHOWN, found.motor), (TOOL_SHOWN, found.tool)), start=1):
            for column, (i, j) in enumerate(entries, start=1):
                first = row == column == 1
                _line(figure, row, column, name, found.frequency_hz, abs(values[:, i, j]), legend=first)
    figure.update_xaxes(type="log")
    figure.update_yaxes(type="log")
    figure.update_layout(height=620, title=f"Pose: {pose}", template="plotly_white")
    return figure


def _line(figure: go.Figure, row: int, column: int, name: str, x: Any, y: Any, legend: bool) -> None:
    measured = name == "measured"
    figure.add_trace(
        go.Scatter(
            x=np.round(x, 6).tolist(),
            y=[float(f"{value:.4g}") for value in y],
            name=name,
            legendgroup=name,
            showlegend=legend,
            mode="markers" if measured else "lines",
            marker={"color": COLOURS[name], "size": 4},
            line={"color": COLOURS[name], "width": 1.6},
        ),
        row=row,
        col=column,
    )
