"""Small line charts as SVG that takes its colours from the page, so that it can be read on light and dark."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

WIDTH, HEIGHT = 320, 220
LEFT, RIGHT, TOP, BOTTOM = 58, 10, 24, 40
STYLES = ("first", "second", "third", "reference")


@dataclass(frozen=True)
class Curve:
    """One line of a chart; `style` is one of STYLES, `dots` draws marks in place of a line."""

    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    style: str = "first"
    name: str = ""
    dots: bool = False


def chart(
    title: str,
    across: str,
    up: str,
    curves: Sequence[Curve],
    *,
    logarithmic: bool = False,
    least_height: float = 0.0,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> str:
    """Return an SVG chart.

    Parameters
    ----------
    title, across, up
        Above the chart, and at its two axes with the unit.
    curves
        What is drawn; curves with a name stand in the key.
    logarithmic
        Whether the abscissa is.
    least_height
        What the ordinate covers at least, so that rounding does not fill the picture.
    """
    width, height = size
    keys = [curve for curve in curves if curve.name]
    top = TOP + (16 * len(keys) if keys else 0)
    x = np.concatenate([np.log10(c.x) if logarithmic else c.x for c in curves])
    y = np.concatenate([c.y[np.isfinite(c.y)] for c in curves])
    around = 0.0 if np.ptp(x) > 0 else 0.5  # of one place alone
    x_range = (float(x.min()) - around, float(x.max()) + around)
    middle, span = (y.min() + y.max()) / 2, max(1.08 * np.ptp(y), least_height, 1e-12)
    y_range = (float(middle - span / 2), float(middle + span / 2))

    def at(a: float, b: float) -> tuple[float, float]:
        return (
            LEFT + (a - x_range[0]) / (x_range[1] - x_range[0]) * (width - LEFT - RIGHT),
            top + (y_range[1] - b) / (y_range[1] - y_range[0]) * (height - top - BOTTOM),
        )

    parts = [f'<text class="title" x="{LEFT}" y="14">{html.escape(title)}</text>']
    for i, curve in enumerate(keys):
        level = TOP + 16 * i + 4
        mark = (
            f'class="{curve.style} dots" d="M{LEFT + 11} {level}h0"'
            if curve.dots
            else f'class="{curve.style}" d="M{LEFT} {level}h22"'
        )
        parts.append(f"<path {mark}/>")
        parts.append(f'<text x="{LEFT + 28}" y="{level + 4}">{html.escape(curve.name)}</text>')
    for value in _ticks(y_range):
        _, level = at(x_range[0], value)
        parts.append(f'<path class="grid" d="M{LEFT} {level:.1f}H{width - RIGHT}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{level + 4:.1f}" text-anchor="end">{_number(value)}</text>')
    for value in _decades(x_range) if logarithmic else _ticks(x_range):
        place, _ = at(value, y_range[0])
        said = _number(10**value if logarithmic else value)
        parts.append(f'<path class="grid" d="M{place:.1f} {height - BOTTOM}v5"/>')
        parts.append(f'<text x="{place:.1f}" y="{height - BOTTOM + 18}" text-anchor="middle">{said}</text>')
    for curve in curves:
        points = [
            at(a, b) for a, b in zip(np.log10(curve.x) if logarithmic else curve.x, curve.y, strict=True)
        ]
        if curve.dots:
            marks = "\n".join(f"M{a:.1f} {b:.1f}h0" for a, b in points)
            parts.append(f'<path class="{curve.style} dots" d="{marks}"/>')
        else:
            way = "\nL".join(f"{a:.1f} {b:.1f}" for a, b in points)
            parts.append(f'<path class="{curve.style}" d="M{way}"/>')
    parts.append(
        f'<text x="{(LEFT + width - RIGHT) / 2}" y="{height - 4}" text-anchor="middle">{html.escape(across)}</text>'
    )
    level = (top + height - BOTTOM) / 2
    turned = f'transform="rotate(-90 13 {level})"'
    parts.append(f'<text x="13" y="{level}" text-anchor="middle" {turned}>{html.escape(up)}</text>')
    return (
        f'<svg class="chart" viewBox="0 0 {width} {height}" width="{width}" role="img" '
        f'aria-label="{html.escape(title)}: {html.escape(up)} over {html.escape(across)}">\n'
        + "\n".join(parts)
        + "</svg>"
    )


def row_of(charts: Sequence[str], caption: str) -> list[str]:
    """Return charts side by side with a caption, as lines of reStructuredText."""
    body = f'<figure class="charts">{"".join(charts)}<figcaption>{html.escape(caption)}</figcaption></figure>'
    return [".. raw:: html", "", *(f"   {line}" for line in body.split("\n")), ""]


def _ticks(limits: tuple[float, float]) -> list[float]:
    low, high = limits
    raw = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda one: abs(one * power - raw))
    return [float(k * step) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _decades(limits: tuple[float, float]) -> list[float]:
    powers = range(int(np.floor(limits[0])), int(np.ceil(limits[1])) + 1)
    every = [float(power + np.log10(step)) for power in powers for step in (1, 2, 5)]
    return [value for value in every if limits[0] - 1e-9 <= value <= limits[1] + 1e-9]


def _number(value: float) -> str:
    text = f"{value:.0f}" if 1e3 <= abs(value) < 1e5 else f"{0.0 if abs(value) < 1e-12 else value:.3g}"
    return text.replace("-", "\N{MINUS SIGN}")
