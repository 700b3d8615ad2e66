"""Artifacts as HTML for notebooks: what they are, why to doubt them, their numbers; no script, all text escaped."""

from __future__ import annotations

from html import escape
from typing import Protocol, runtime_checkable

from robid_core.artifacts.artifact import Artifact
from robid_core.artifacts.fields import field_lines
from robid_core.artifacts.fit import Diagnosis, Fit
from robid_core.artifacts.record import Record
from robid_core.artifacts.summary import summary
from robid_core.artifacts.tables import Table

DOUBTED = "border-left:4px solid #b3261e;padding-left:8px"


@runtime_checkable
class Tabled(Protocol):
    """What has a table that a person reads."""

    def table(self) -> Table:
        """Return it."""


def artifact_html(artifact: Artifact) -> str:
    """Return a fragment: heading, one sentence, doubts, a verdict, a table where there is one, every field folded."""
    table = shown_table(artifact)
    parts = [
        f"<b>{type(artifact).__name__}</b> {escape(summary(artifact))}",
        *(f'<p style="{DOUBTED}">{escape(text)}</p>' for text in warnings(artifact)),
        verdict_html(artifact) if isinstance(artifact, Diagnosis) else "",
        table._repr_html_() if table else "",
    ]
    fields = escape("\n".join(field_lines(artifact, "")))
    return f"<div>{''.join(parts)}<details><summary>fields</summary><pre>{fields}</pre></details></div>"


def verdict_html(diagnosis: Diagnosis) -> str:
    """Return the verdict, a line for each finding."""
    return f"<p>{'<br>'.join(escape(line) for line in diagnosis.verdict.splitlines())}</p>"


def warnings(artifact: Artifact) -> list[str]:
    """Return what a reader must know before any number."""
    if isinstance(artifact, Fit | Diagnosis):
        return [str(doubt) for doubt in artifact.doubts]
    if isinstance(artifact, Record):
        missing = sum(int((~run.valid).sum()) for run in artifact.runs)
        return [f"{missing} samples were not measured"] if missing else []
    return []


def shown_table(artifact: Artifact) -> Table | None:
    """Return the table that stands below the sentence; None where there is none, or nothing in it.

    Of a record it is the first experiment, and none where runs of several lengths have no first one in common.
    """
    if isinstance(artifact, Record) and len(artifact.runs) != 1:
        return None
    if not isinstance(artifact, Tabled):
        return None
    table = artifact.table()
    return table if any(table.values()) else None
