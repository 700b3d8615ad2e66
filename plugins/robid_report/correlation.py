"""Correlations of estimates as a heat map: which parameters the data cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from robid_core import Fit, FloatArray

STRONG = 0.9  # pairs beyond are named
MOST_NAMED = 6
CELL, LABEL, LETTER, TOP = 20.0, 26.0, 6.6, 20.0  # of the drawing, a letter of the names 6.6 wide
FAINT = 0.05  # less is drawn as nothing
FEW = 16  # parameters that a phone shows whole; a map of more is moved sideways


@dataclass(frozen=True)
class Correlation:
    """The picture and the strongest pairs in words."""

    picture: Markup
    strong: list[str]
    """Pairs beyond the limit; where some parameters are reported, those of at least one of them."""
    n: int
    reported: Markup | None
    """Picture of the reported parameters alone; None where they are all, or fewer than two."""
    derived: int
    """How many parameters of the robot have a standard error and no place in the covariance."""


def correlation_of(fit: Fit | None) -> Correlation | None:
    """Return the heat map of the robot's parameters; None for fewer than two, or without a covariance."""
    if fit is None or len(fit.free_names) != len(fit.covariance):
        return None
    groups = dict(zip(fit.parameters.names, fit.parameters.groups, strict=True))
    variance = np.diagonal(fit.covariance)
    chosen = [
        i
        for i, name in enumerate(fit.free_names)
        if groups.get(name, "nuisance") != "nuisance" and np.isfinite(variance[i]) and variance[i] > 0
    ]
    if len(chosen) < 2:
        return None
    names = [fit.free_names[i] for i in chosen]
    if not np.isfinite(fit.covariance[np.ix_(chosen, chosen)]).all():
        return None
    matrix = fit.correlation(names)
    reported = dict(zip(fit.parameters.names, fit.parameters.reported, strict=True))
    shown = np.array([bool(reported.get(name)) for name in names])
    rows, columns = np.triu_indices(len(names), 1)
    if shown.any():
        asked = shown[rows] | shown[columns]
        rows, columns = rows[asked], columns[asked]
    order = np.argsort(-np.abs(matrix[rows, columns]), kind="stable")[:MOST_NAMED]
    strong = [
        f"{names[rows[k]]} and {names[columns[k]]} {_text(matrix[rows[k], columns[k]])}"
        for k in order
        if abs(matrix[rows[k], columns[k]]) >= STRONG
    ]
    alone = None
    if 2 <= shown.sum() < len(names):
        alone = _picture([names[i] for i in np.flatnonzero(shown)], matrix[np.ix_(shown, shown)])
    errors = zip(fit.parameters.names, fit.parameters.standard_error.tolist(), strict=True)
    derived = [
        n for n, error in errors if groups[n] != "nuisance" and error == error and n not in fit.free_names
    ]
    return Correlation(_picture(names, matrix), strong, len(names), alone, len(derived))


def _picture(names: list[str], matrix: FloatArray) -> Markup:
    n = len(names)
    left = LABEL + LETTER * max(len(name) for name in names)
    cells, labels = [], []
    for i, name in enumerate(names):
        y = TOP + CELL * i
        labels.append(
            f'<text x="{left - 6:.0f}" y="{y + 14:.0f}" text-anchor="end">{escape(name)} {i + 1}</text>'
            f'<text x="{left + CELL * (i + 0.5):.0f}" y="14" text-anchor="middle">{i + 1}</text>'
        )
        for j in range(n):
            value = float(matrix[i, j])
            if abs(value) < FAINT:
                continue
            kind = "positive" if value > 0 else "negative"
            title = "" if i == j else f"<title>{escape(name)}, {escape(names[j])}: {_text(value)}</title>"
            cells.append(
                f'<rect class="{kind}" x="{left + CELL * j:.0f}" y="{y:.0f}" width="{CELL - 1:g}" '
                f'height="{CELL - 1:g}" fill-opacity="{min(abs(value), 1.0):.2f}">{title}</rect>'
            )
    width, height = left + CELL * n, TOP + CELL * n
    kind = "correlation few" if n <= FEW else "correlation"
    return Markup(
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}" class="{kind}" '
        f'role="img" aria-label="correlations of the estimates">{"".join(labels)}{"".join(cells)}</svg>'
    )


def _text(value: float) -> str:
    return f"{value:+.2f}".replace("-", "−")
