"""Friction over speed, axis by axis: as it was measured, and the law of the robot file."""

from __future__ import annotations

from typing import Any

from robid_core import Fit
from robid_report.chart import chart


def friction_sections(fit: Fit | None) -> list[dict[str, Any]]:
    """Return for each axis its law in words and a picture: dots are what was measured, the line is the law."""
    return [
        {
            "axis": one.axis,
            "law": one.law,
            "picture": chart(
                f"motor speed, {one.speed_unit}",
                one.unit_symbol,
                one.speed,
                one.measured,
                {"law": one.fitted},
                spoken=f"friction of {one.axis} over its speed",
            ),
        }
        for one in (fit.friction if fit is not None else ())
    ]
