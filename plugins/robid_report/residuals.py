"""What is left of the torque of each axis, over all that it may be a function of, before and after a diagnosis."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from robid_core import Diagnosis, ResidualCurve
from robid_report.chart import chart
from robid_report.numbers import percent

WORTH = 0.01  # of the squared residual: less is not told
MOST = 3  # variables that are told in words


def residual_sections(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return for each axis a sentence and its pictures; open where something was found, or there is one only."""
    curves = diagnosis.residuals if diagnosis is not None else ()
    named = {finding.on for finding in diagnosis.findings} if diagnosis is not None else set()
    sections = []
    for axis, group in itertools.groupby(curves, key=lambda one: one.axis):
        own = list(group)
        pictures = [_picture(curve) for curve in own]
        sections.append({"axis": axis, "told": _told(own), "pictures": pictures, "open": axis in named})
    if len(sections) == 1:
        sections[0]["open"] = True
    return sections


def _told(curves: list[ResidualCurve]) -> str:
    """Of what the residual is a function, the largest part first."""
    known = [one for one in curves if np.isfinite(one.share) and one.share > WORTH]
    parts = []
    for one in sorted(known, key=lambda one: -one.share)[:MOST]:
        halves = (
            f" (odd {percent(one.odd)}, even {percent(one.even)})" if np.isfinite(one.odd + one.even) else ""
        )
        parts.append(f"{one.variable.partition(',')[0]} {percent(one.share)}{halves}")
    if not parts:
        return "No single variable explains the residual of the refitted robot."
    shares = "; ".join(parts)
    return f"Share of the squared residual of the refitted robot that a function of one variable explains: {shares}."


def _picture(curve: ResidualCurve) -> Any:
    """Dots: the refitted robot. Lines: the robot that was found, and the measured torque where sizes are compared."""
    lines = {"law": curve.extended}
    if curve.measured is not None:
        lines = {"torque": curve.measured, **lines}
    return chart(
        curve.variable,
        curve.unit_symbol,
        curve.abscissa,
        curve.refitted,
        lines,
        spoken=f"residual on {curve.axis} over {curve.variable}",
        logarithmic=(curve.variable.startswith("frequency"), curve.measured is not None),
    )
