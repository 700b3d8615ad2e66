"""The study as one page: an experiment as it is measured, a window as it is fitted, and what every method comes to.

The upper part is computed from one measurement of the reference bench, the lower part reads the tables beside the
study; a table that is not there yet is left out, with a line that says how to make it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
import plotly.io
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from robid_core import ComplexArray
from studies.frf_methods import figures_accuracy, figures_tables, figures_variants, figures_window
from studies.frf_methods.figures_signals import Shown, measured, signal_figures, signals
from studies.frf_methods.figures_style import CONFIG, FAMILIES, FITS, Row
from studies.frf_methods.measurement import SETTLE_PERIODS, chance
from studies.frf_methods.scenes import Scene
from studies.frf_methods.tables import HERE, read_table

TABLES = {
    "accuracy": "Accuracy of every method",
    "iterations": "Local fits with and without iterations",
    "coverage": "Coverage of the stated regions",
    "stiffness": "Errors of the stiffnesses",
    "variants": "The same robots otherwise",
    "amplitude": "Response against excitation amplitude",
}
SHOWN_SEED = 0  # of the measurement that is shown; those of the tables count from one
FIRST_CASE = "peak"


def study_page(path: Path, scene: Scene) -> Path:
    """Measure a scene once, and write the page with the tables that there are."""
    shown = measured(
        scene.robot, scene.nominal, scene.angle, scene.excitation, chance(scene.plant, scene.pose, SHOWN_SEED)
    )
    where = f"plant {scene.plant} of the reference bench, configuration {scene.pose}"
    return write_page(path, shown, present_tables(), truth=scene.truth.response, where=where)


def present_tables() -> dict[str, list[dict[str, str]]]:
    """The tables beside the study, those that have been made."""
    return {name: read_table(name) for name in TABLES if (HERE / f"{name}.csv").exists()}


def write_page(
    path: Path,
    shown: Shown,
    tables: Mapping[str, Sequence[Row]],
    *,
    truth: ComplexArray | None = None,
    where: str = "",
) -> Path:
    """Write one self-contained HTML file; equal inputs give equal bytes.

    Parameters
    ----------
    path
        Where to.
    shown
        The measurement of the upper part (`figures_signals.measured`).
    tables
        Rows by name: accuracy, coverage, stiffness, amplitude; those that are missing are named on the page.
    truth
        Best linear approximation of the measured plant, (n_freq, n_out, n_in): windows show errors against it.
    where
        Plant and configuration in words.
    """
    cases, windows, sizes = figures_window.window_figures(shown.record, truth)
    figures = signal_figures(shown) | table_figures(tables, experiment_time_s(shown))
    data = {
        "figures": {name: as_json(figure) for name, figure in figures.items()},
        "windows": {
            f"window-{count}": {key: as_json(figure) for key, figure in by_case.items()}
            for count, by_case in windows.items()
        },
        "signals": signals(shown),
        "config": CONFIG,
    }
    folder = Path(__file__).parent
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.from_string((folder / "page.html.j2").read_text(encoding="utf-8")).render(
        where=where,
        facts=facts(shown),
        axes=shown.record.axis_names,
        n_block=shown.record.run.valid.shape[1],
        n_exp=shown.record.run.valid.shape[2],
        cases=cases,
        first_case=FIRST_CASE,
        windows={f"window-{count}": (count, sizes[count]) for count in windows},
        parametrizations=FITS,
        has_truth=truth is not None,
        families=FAMILIES,
        figures=set(figures),
        tables=[
            (name, title, columns(tables[name]), tables[name])
            for name, title in TABLES.items()
            if name in tables
        ],
        missing=[name for name in TABLES if name not in tables],
        data=json_for_script(data),
        library=Markup(get_plotlyjs()),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def table_figures(tables: Mapping[str, Sequence[Row]], seconds: float) -> dict[str, go.Figure]:
    """Figures of the tables that there are; a table without the columns for a figure has none."""
    found: dict[str, go.Figure | None] = {}
    accuracy = tables.get("accuracy", ())
    if figures_accuracy.with_experiments(accuracy, figures_accuracy.MOST):
        found["ranking"] = figures_accuracy.ranking(accuracy)
        found["bands"] = figures_accuracy.by_band(accuracy)
        found |= figures_accuracy.efficiency_figures(accuracy, seconds)
    found["stiffness"] = figures_tables.stiffness(tables.get("stiffness", ()))
    found["coverage"] = figures_tables.coverage(tables.get("coverage", ()))
    found["sizes"] = figures_tables.region_sizes(tables.get("coverage", ()))
    others = tables.get("variants", ())
    found["smooth"] = figures_variants.without_friction(others)
    found["excitations"] = figures_variants.other_excitations(others)
    found["amplitude"] = figures_variants.amplitude(tables.get("amplitude", ()))
    return {name: figure for name, figure in found.items() if figure is not None}


def experiment_time_s(shown: Shown) -> float:
    """Time of one experiment with the period in which it settles."""
    run = shown.record.run
    return float((run.n_period + SETTLE_PERIODS) * len(run.time_s) * run.sample_time_s)


def facts(shown: Shown) -> list[tuple[str, str]]:
    """The measurement in a few numbers."""
    run, frequency = shown.record.run, shown.record.frequency_hz
    n_block, n_exp = run.valid.shape[1:3]
    period = len(run.time_s) * run.sample_time_s
    return [
        ("experiments", f"{n_block} blocks of {n_exp}"),
        ("one experiment", f"{SETTLE_PERIODS} period to settle, {run.n_period} kept, {period:g} s each"),
        ("excited lines", f"{len(frequency)}, {frequency[0]:.3g} to {frequency[-1]:.3g} Hz"),
        ("all of it", f"{n_block * n_exp * experiment_time_s(shown) / 60:.3g} min"),
    ]


def columns(rows: Sequence[Row]) -> list[str]:
    """Keys of all rows, in the order in which they come."""
    return list(dict.fromkeys(key for row in rows for key in row))


def as_json(figure: go.Figure) -> Any:
    """A figure as plain data."""
    return json.loads(plotly.io.to_json(figure, remove_uids=True))


def json_for_script(data: Any) -> Markup:
    """JSON that may stand in a script element."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, sort_keys=True, allow_nan=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))
