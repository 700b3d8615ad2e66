"""Artifacts as HTML for notebooks: what they are, their numbers, why to doubt them; no script, all text escaped."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from robid_core.artifacts.artifact import Artifact
from robid_core.artifacts.configurations import Configurations
from robid_core.artifacts.design import Design
from robid_core.artifacts.excitation import Excitation
from robid_core.artifacts.fields import field_lines
from robid_core.artifacts.fit import Diagnosis, Fit
from robid_core.artifacts.frf import Frf
from robid_core.artifacts.record import Record
from robid_core.artifacts.report import Report
from robid_core.artifacts.tables import Table

DOUBTED = "border-left:4px solid #b3261e;padding-left:8px"


def artifact_html(artifact: Artifact) -> str:
    """Return a fragment: heading, one sentence, doubts, a table where the kind has one, and every field, folded."""
    table = shown_table(artifact)
    parts = [
        f"<b>{type(artifact).__name__}</b> {escape(summary(artifact))}",
        *(f'<p style="{DOUBTED}">{escape(text)}</p>' for text in warnings(artifact)),
        table._repr_html_() if table else "",
    ]
    fields = escape("\n".join(field_lines(artifact, "")))
    return f"<div>{''.join(parts)}<details><summary>fields</summary><pre>{fields}</pre></details></div>"


def summary(artifact: Artifact) -> str:
    """Say in a sentence what an artifact holds."""
    if isinstance(artifact, Fit):
        against = artifact.misfit_against
        misfit = f", misfit {artifact.misfit:.3g} against {against}" if against else ""
        agree = f"{artifact.n_agree} of {artifact.n_starts} starts agree"
        return f"by {artifact.method}: {artifact.status}{misfit}; {agree}"
    if isinstance(artifact, Frf):
        masked = int((~artifact.valid_lines).sum())
        left = f", {masked} lines left out" if masked else ""
        f = artifact.frequency_hz
        return (
            f"by {artifact.estimator}: {len(artifact.response)} configurations, {len(f)} lines from {f.min():.4g} to "
            f"{f.max():.4g} Hz of {_listed(artifact.axis_names)}{left}; uncertainty: {artifact.pooling}"
        )
    if isinstance(artifact, Record):
        seconds = sum(run.valid.size * run.sample_time_s for run in artifact.runs)
        names = dict.fromkeys(name for run in artifact.runs for name in run.channels)
        lines = "" if artifact.line is None else f", {len(artifact.line)} excited lines"
        return (
            f"({artifact.source}): {len(artifact.angle)} configurations, {seconds:.4g} s of "
            f"{_listed(artifact.axis_names)}{lines}; channels {', '.join(names)}"
        )
    if isinstance(artifact, Excitation):
        return (
            f"of {_listed(artifact.axis_names)}: periods of {artifact.period_s:.4g} s, {len(artifact.line)} lines, "
            f"{artifact.experiment_time_s:.4g} s in all without settling"
        )
    if isinstance(artifact, Design):
        return (
            f"by criterion {artifact.criterion}: the optimum is at most {artifact.gap:.2g} away, efficiency "
            f"{artifact.efficiency:.4g} after rounding"
        )
    if isinstance(artifact, Diagnosis):
        return f"by {artifact.method}: {artifact.verdict}"
    if isinstance(artifact, Report):
        return f": a page of {len(artifact.html) / 1000:.0f} kB; write it to a file and open it in a browser"
    return ""


def warnings(artifact: Artifact) -> list[str]:
    """Return what a reader must know before any number."""
    if isinstance(artifact, Fit):
        return [str(doubt) for doubt in artifact.doubts]
    if isinstance(artifact, Record):
        missing = sum(int((~run.valid).sum()) for run in artifact.runs)
        return [f"{missing} samples were not measured"] if missing else []
    return []


def shown_table(artifact: Artifact) -> Table | None:
    """Return the table that stands below the sentence; None where the kind has none that a person reads."""
    if isinstance(artifact, Fit):
        return artifact.table()
    if isinstance(artifact, Diagnosis):
        return artifact.table() if artifact.findings else None
    if isinstance(artifact, Configurations):
        return artifact.table()
    if isinstance(artifact, Excitation) and artifact.predicted_torque is not None:
        return _predictions(artifact)
    return None


def _predictions(excitation: Excitation) -> Table:
    """Return for each axis the largest torque and speed that a simulation promises."""
    table = Table(axis=list(excitation.axis_names))
    for name, values in (
        ("torque, N m", excitation.predicted_torque),
        ("of its limit", None if excitation.torque_limit is None else _share(excitation)),
        ("speed, rad/s", excitation.predicted_speed),
        ("travel, rad", excitation.predicted_travel),
    ):
        if values is not None:
            table[name] = np.max(values, axis=0).tolist()
    return table


def _share(excitation: Excitation) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    assert excitation.predicted_torque is not None
    assert excitation.torque_limit is not None
    result: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = (
        excitation.predicted_torque / excitation.torque_limit
    )
    return result


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)
