"""The page: everything a run found, in one file that opens without network, today and in ten years.

Text of the user (names, units, errors) reaches the page through jinja2 with escaping, or as JSON data that the
page's own script writes as text. The policy in the page's head allows those scripts by their hash and nothing
from outside. No clock unless asked, and fixed ids: equal inputs give equal bytes.
"""

from __future__ import annotations

import dataclasses
import datetime
import platform
import sys
from importlib import metadata, resources
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from robid_core import (
    Context,
    Design,
    Diagnosis,
    Excitation,
    Fit,
    FloatArray,
    Frf,
    Record,
    Report,
    ReportStage,
    Robot,
    TimeComparison,
    Truth,
    link_meshes,
)
from robid_core.plot import DARK, beside, pooled
from robid_report.beside import comparison, fit_with_response, other_fits
from robid_report.body import body_data
from robid_report.causes import cause_sections
from robid_report.correlation import correlation_of
from robid_report.findings import facts, findings, steps
from robid_report.friction import friction_sections
from robid_report.meshes import told_once
from robid_report.misfits import misfit_sections
from robid_report.numbers import breakable, percent, significant, times, with_code, without_folders
from robid_report.packed import json_for_script, packed_json, packed_library, script_hash
from robid_report.parameters import essential_rows, relative_error, rows
from robid_report.plots import response_plots, time_plots
from robid_report.prediction import curve_sections, error_sections, run_sections
from robid_report.refitted import refitted_table
from robid_report.residuals import residual_sections
from robid_report.response_check import response_check_table
from robid_report.steady_state import spectra_of, steady_state
from robid_report.stick_figure import VIEWS, draw, is_worth_drawing, skeleton
from robid_report.visible import visible_table

LIBRARIES = ("numpy", "scipy", "numba", "pydantic", "h5py", "pin", "cvxpy", "python-can", "canopen", "plotly")

NO_WEIGHT = 5e-4
"""A pose with less of the weight, at which nothing is measured, is not shown."""


def versions() -> list[tuple[str, str, str]]:
    """Python, every distribution that brings stages, and the libraries below: (name, version, what it brings)."""
    brought: dict[str, list[str]] = {}
    for point in metadata.entry_points(group="robid.stages"):
        if point.dist is not None and (name := _name_of(point.dist)):
            brought.setdefault(name, []).append(point.name)
    result = [("Python", ".".join(str(part) for part in sys.version_info[:3]), "")]
    for name in sorted(brought):
        result.append((name, metadata.version(name), ", ".join(sorted(set(brought[name])))))
    for name in LIBRARIES:
        try:
            result.append((name, metadata.version(name), ""))
        except metadata.PackageNotFoundError:
            continue
    return result


def _name_of(distribution: metadata.Distribution) -> str:
    """Return the name of a package, empty where its metadata are damaged."""
    try:
        return distribution.metadata["Name"] or ""
    except (KeyError, FileNotFoundError, UnicodeDecodeError):
        return ""


def angles_as_text(robot: Robot, angle: FloatArray) -> list[list[str]]:
    """Joint-side motor angles in degrees (millimetres on a prismatic axis), one list for each configuration."""
    linear = robot.chain.joint_type[robot.mechanism.arm] == 1
    shown = np.where(linear, 1000 * angle, np.degrees(angle))
    units = [" mm" if straight else "°" for straight in linear]
    return [
        [f"{value:.1f}{unit}".replace("-", "−") for value, unit in zip(row, units, strict=True)]
        for row in shown
    ]


def figures(robot: Robot, angle: FloatArray) -> list[list[Markup]]:
    """Side and top view of each configuration; empty where there is nothing to see."""
    body = skeleton(robot, angle)
    if not is_worth_drawing(body):
        return []
    return [[draw(body, c, view) for view in VIEWS] for c in range(len(angle))]


def response_section(
    robot: Robot, frf: Frf | None, fit: Fit | None, record: Record | None
) -> tuple[dict[str, Any] | None, list[tuple[str, TimeComparison]]]:
    """Figures of the measured responses beside the model, and the model's steady state beside the record over time.

    A fit of other data than responses is drawn as its model answers in the configurations of `frf`.
    """
    comparison = fit.response if fit is not None else None
    of_responses = comparison is not None
    fitted = fit is not None and (of_responses or fit.model is not None)
    if comparison is None:
        if frf is None:
            return None, []
        comparison = beside(frf, robot)
        if fit is not None and fit.model is not None:
            comparison = dataclasses.replace(
                beside(frf, Robot.of_model(fit.model)), start=comparison.start, curve_start=comparison.curve
            )
    spectra = spectra_of(record, comparison.frequency_hz)
    steady = steady_state(record, spectra, comparison) if record is not None and spectra is not None else None
    model_name = f"model of {short_method(fit)}" if fit is not None and fitted else "robot file"
    over_time = (
        [] if steady is None else [(f"Excited lines, configuration {steady[0] + 1}, {model_name}", steady[1])]
    )
    return response_plots(comparison, fitted, of_responses, frf, spectra), over_time


def short_method(fit: Fit) -> str:
    """Return a fit's method without what stands after the first comma: `log response`."""
    return fit.method.partition(",")[0]


def body_section(
    robot: Robot, loaded: Robot, angle: FloatArray | None, frf: Frf | None
) -> dict[str, Any] | None:
    """The robot that can be turned, with its modes up to a quarter above the measured band, and how it is drawn.

    Meshes are those of the robot as it was `loaded`: one made of a fit has no file.
    """
    highest = 1.25 * float(frf.frequency_hz[-1]) if frf is not None else 200.0
    found = body_data(robot, angle, highest, link_meshes(loaded)) if angle is not None else None
    if found is None:
        return None
    data, meshes = found
    return {"data": json_for_script(data), "drawing": meshes.in_words(), "remarks": told_once(meshes.remarks)}


def design_section(robot: Robot, design: Design | None, fit: Fit | None) -> dict[str, Any] | None:
    """Chosen configurations as text and pictures, and the standard errors they promise."""
    if design is None:
        return None
    pictures = figures(robot, design.angle)
    chosen = [
        {
            "angles": angles,
            "weight": percent(float(design.weight[i])),
            "bar": round(100 * float(design.weight[i] / design.weight.max()), 1),
            "measure": f"Measure here {times(int(design.experiments[i]))}"
            if design.experiments[i]
            else "Do not measure here",
            "pictures": pictures[i] if pictures else [],
        }
        for i, angles in enumerate(angles_as_text(robot, design.angle))
        if design.experiments[i] or design.weight[i] >= NO_WEIGHT
    ]
    achieved = {}
    if fit is not None:
        table = fit.parameters
        achieved = {
            n: relative_error(float(table.standard_error[i]), float(table.estimate[i]))
            for i, n in enumerate(table.names)
        }
    promised = [
        (name, percent(float(error)), achieved.get(name, "–"))
        for name, error in zip(design.parameter_names, design.predicted_standard_error, strict=True)
    ]
    return {
        "chosen": chosen,
        "promised": promised,
        "criterion": design.criterion,
        "gap": significant(design.gap, 2),
        "efficiency": percent(design.efficiency),
    }


def made(date: bool, host: bool) -> str:
    """Say when and where the page is made, as far as it is asked: `made on 2026-05-04 at 10:30 UTC on bench-3`."""
    parts = [f"on {datetime.datetime.now(datetime.UTC):%Y-%m-%d at %H:%M UTC}"] if date else []
    parts += [f"on {platform.node()}"] if host else []
    return " ".join(("made", *parts)) if parts else ""


def render(content: dict[str, Any], data: dict[str, Any]) -> str:
    """Fill the template; `data` goes to the page's script, `content` into the text."""
    files = resources.files("robid_report")
    from jinja2 import Environment, StrictUndefined  # slow to import

    text = {
        name: (files / name).read_text(encoding="utf-8")
        for name in ("page.html.j2", "page.css", "figures.js", "page.js", "body.js")
    }
    scripts = [text["figures.js"], text["page.js"], *([text["body.js"]] if content["body"] else [])]
    allowed, library = [script_hash(script) for script in scripts], ""
    if data["response"] or data["time"]:
        library, own = packed_library()
        allowed.insert(0, own)
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda part: without_folders(part) if type(part) is str else part,
    )
    environment.filters["code"] = with_code
    environment.filters["breakable"] = breakable
    page: str = environment.from_string(text["page.html.j2"]).render(
        **content,
        data=packed_json(pooled({**data, "dark": DARK})),
        style=Markup(text["page.css"]),
        library=Markup(library),
        scripts=[Markup(script) for script in scripts],
        policy=Markup(" ".join(f"'{one}'" for one in allowed)),
        versions=versions(),
    )
    return page


class HtmlReport(ReportStage):
    """One self-contained HTML page of whatever the pipeline has made.

    page:
      use: report.html
      with: {title: Six-axis robot, spring, date: true, host: true}
    """

    title: str = ""
    """Heading of the page; by default the run's name, outside of a run the robot's."""
    date: bool = False
    """Whether the page says when it was made; then equal inputs give equal pages no more."""
    host: bool = False
    """Whether the page says on which computer it was made."""

    def run(
        self,
        robot: Robot,
        frf: Frf | None = None,
        fit: Fit | None = None,
        record: Record | None = None,
        design: Design | None = None,
        diagnosis: Diagnosis | None = None,
        excitation: Excitation | None = None,
        truth: Truth | None = None,
        fits: tuple[Fit, ...] = (),
        context: Context | None = None,
    ) -> Report:
        """Collect what there is and write the page; of several `fits` the others stand beside `fit`."""
        others, responding = other_fits(fit, fits), fit_with_response(fit, fits)
        response, steady = response_section(robot, frf, responding, record)
        angle = frf.angle if frf is not None else record.angle if record is not None else None
        table, limit = rows(fit.parameters, truth) if fit is not None else ([], 0.0)
        comparisons = [("Inverse model", c) for c in fit.time] if fit is not None else []
        comparisons += (
            [(diagnosis.method.capitalize(), c) for c in diagnosis.time] if diagnosis is not None else []
        )
        comparisons += steady
        model = responding.model if responding is not None else None
        content = {
            "title": self.title or (context.run_name if context is not None else "") or robot.name,
            "robot": robot.name,
            "made": made(self.date, self.host),
            "axes": robot.axis_names,
            "findings": findings(
                frf,
                [one for one in (fit, *others) if one is not None],
                record,
                design,
                diagnosis,
                truth,
                context.warnings if context is not None else (),
            ),
            "facts": facts(frf, fit, record, design, diagnosis, truth),
            "verdict": diagnosis.verdict.split("\n") if diagnosis is not None else [],
            "causes": cause_sections(diagnosis),
            "residuals": residual_sections(diagnosis),
            "rows": [row for row in table if row.reported],
            "nuisances": [row for row in table if not row.reported],
            "unreported": fit.parameters.unreported() if fit is not None else "",
            "spread": any(row.spread for row in table),
            "base": rows(fit.base, None)[0] if fit is not None and fit.base is not None else [],
            "essential": essential_rows(fit.essential) if fit is not None else None,
            "plant": "" if truth is None else Path(truth.plant).name,  # no folder of the machine
            "limit": f"{100 * limit:g} %",
            "beside": [comparison(fit, other) for other in others],
            "responding": responding.method if responding is not None and responding is not fit else "",
            "friction": friction_sections(fit),
            "misfits": misfit_sections(fit, diagnosis),
            "errors": error_sections(diagnosis),
            "runs": run_sections(diagnosis),
            "curves": curve_sections(diagnosis),
            "refitted": refitted_table(diagnosis),
            "visible": visible_table(diagnosis),
            "response_check": response_check_table(diagnosis),
            "response": response is not None,
            "fitted": response is not None and response["fitted"],
            "panels": list(response["rows"]) if response is not None else [],
            "steady": bool(steady),
            "correlation": correlation_of(fit),
            "configurations": angles_as_text(robot, angle) if angle is not None else [],
            "pictures": figures(robot, angle) if angle is not None else [],
            "body": body_section(robot if model is None else Robot.of_model(model), robot, angle, frf),
            "body_is_fitted": model is not None,
            "time": [time_plots(comparison, title) for title, comparison in comparisons],
            "design": design_section(robot, design, responding),
            "steps": steps(excitation, record, frf, fit, design, diagnosis),
        }
        return Report(html=render(content, {"response": response, "time": content["time"]}))
