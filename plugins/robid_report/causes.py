"""What a diagnosis found, each with a picture: residual torque over the variable in which the law lives."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from robid_core import Diagnosis, Finding
from robid_report.chart import chart
from robid_report.numbers import significant, to_error

HEADINGS = {
    "cause": "Cause",
    "partial": "Part of a cause",
    "unknown": "Unknown cause",
    "value": "Wrong value",
}


def cause_sections(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return what the page shows of each finding: heading, numbers as text, a picture where there is one."""
    return [_section(finding) for finding in (diagnosis.findings if diagnosis is not None else ())]


def _section(finding: Finding) -> dict[str, Any]:
    seen = np.isfinite(finding.by_configuration).all() and len(finding.by_configuration) > 0
    rows = [
        (
            name,
            unit if unit != "1" else "",
            significant(float(told), 4) if np.isfinite(told) else "–",
            to_error(float(value), float(error)),
            f"± {significant(float(error), 2)}" if np.isfinite(error) else "not determined",
        )
        for name, unit, told, value, error in zip(
            finding.names, finding.units, finding.nominal, finding.value, finding.standard_error, strict=True
        )
    ]
    return {
        "kind": finding.kind,
        "heading": f"{HEADINGS[finding.kind]}: {finding.effect}, {finding.where}",
        "rows": rows,
        "gain": significant(finding.gain, 3),
        "chance": "below 0.001" if finding.p_value < 1e-3 else significant(finding.p_value, 2),
        "seen": f"{finding.n_seen} of {len(finding.by_configuration)}" if seen else "",
        "ties": list(finding.ties),
        "separation": "" if finding.separation is None else finding.separation.sentence,
        "picture": _picture(finding),
    }


def _picture(finding: Finding) -> Markup | None:
    """Dots of the residual and the law's line; none where the finding has no picture."""
    x, dots, line = finding.abscissa, finding.residual, finding.explained
    if x is None or dots is None or line is None:
        return None
    return chart(
        finding.variable, "N m", x, dots, {"law": line}, spoken=f"residual torque over {finding.variable}"
    )
