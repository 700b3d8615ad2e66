"""What a diagnosis found, each with a picture: residual torque over the variable in which the law lives."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup, escape

from robid_core import Diagnosis, Finding, FloatArray
from robid_report.numbers import significant

WIDTH, HEIGHT, LEFT, BOTTOM = 560.0, 240.0, 64.0, 34.0
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
            significant(float(value), 4),
            significant(float(error), 2),
        )
        for name, unit, told, value, error in zip(
            finding.names, finding.units, finding.told, finding.value, finding.standard_error, strict=True
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
    """Dots of the residual and the law's line, as SVG; none where the finding has no picture."""
    x, dots, line = finding.abscissa, finding.residual, finding.explained
    if x is None or dots is None or line is None:
        return None
    across = _scale(x, LEFT, WIDTH - 12)
    up = _scale(np.concatenate((dots, line)), HEIGHT - BOTTOM, 12)
    points = "".join(
        f'<circle cx="{across(a):.1f}" cy="{up(b):.1f}" r="3"/>' for a, b in zip(x, dots, strict=True)
    )
    path = "L".join(f"{across(a):.1f} {up(b):.1f}" for a, b in zip(x, line, strict=True))
    ticks = "".join(
        f'<path class="tick" d="M{across(v):.1f} {HEIGHT - BOTTOM:.1f}v5"/>'
        f'<text x="{across(v):.1f}" y="{HEIGHT - BOTTOM + 17:.1f}" text-anchor="middle">{_plain(v)}</text>'
        for v in _ticks(x)
    ) + "".join(
        f'<path class="grid" d="M{LEFT} {up(v):.1f}H{WIDTH - 12}"/>'
        f'<text x="{LEFT - 6}" y="{up(v) + 4:.1f}" text-anchor="end">{_plain(v)}</text>'
        for v in _ticks(np.concatenate((dots, line)))
    )
    label = escape(finding.variable)
    return Markup(
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT + 14:g}" class="cause" role="img" aria-label="residual torque over '
        f'{label}">{ticks}<g class="dots">{points}</g><path class="law" d="M{path}"/>'
        f'<text x="{(LEFT + WIDTH) / 2:g}" y="{HEIGHT + 10:g}" text-anchor="middle">{label}</text>'
        f'<text x="12" y="{HEIGHT / 2:g}" transform="rotate(-90 12 {HEIGHT / 2:g})" text-anchor="middle">torque, N m'
        "</text></svg>"
    )


def _scale(values: FloatArray, first: float, last: float) -> Any:
    low, high = float(values.min()), float(values.max())
    span = (high - low) or 1.0
    return lambda value: first + (last - first) * (value - low) / span


def _ticks(values: FloatArray) -> list[float]:
    """About five round numbers within a range."""
    low, high = float(values.min()), float(values.max())
    raw = ((high - low) or 1.0) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda one: abs(one * power - raw))
    return [float(k * step) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _plain(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-12 else value:.3g}".replace("-", "−")
