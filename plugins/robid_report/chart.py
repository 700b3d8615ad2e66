"""Small charts as SVG: dots and lines over one variable."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from markupsafe import Markup, escape

from robid_core import FloatArray

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560.0, 240.0, 80.0, 12.0, 12.0, 34.0
FEWEST_TICKS = 3
DECADES = 4.0  # below the largest value, where an axis is logarithmic: less is drawn at the edge
Scale = Callable[[float], float]


def chart(
    label: str,
    unit: str,
    x: FloatArray,
    dots: FloatArray | Mapping[str, FloatArray],
    lines: Mapping[str, FloatArray],
    *,
    spoken: str,
    logarithmic: tuple[bool, bool] = (False, False),
    ordinate: str = "",
    limits: tuple[float, float] | None = None,
    band: tuple[FloatArray, FloatArray] | None = None,
) -> Markup:
    """Draw dots and lines.

    Parameters
    ----------
    label, unit
        Of the abscissa, and of the torque or force.
    x, dots
        Shape (n_point,) each; dots of several colours by their class in the style sheet, NaN where there is none.
    lines
        By their class in the style sheet, (n_point,) each, with gaps where NaN.
    spoken
        What a screen reader says.
    logarithmic
        Whether the abscissa is, and the ordinate; then nothing on it is negative.
    ordinate
        What is drawn, where it is no torque or force.
    limits
        Lowest and highest value of the ordinate; by default those of what is drawn.
    band
        Lower and upper edge of an area behind all, (n_point,) each, not drawn where NaN.
    """
    by_decade, in_decades = logarithmic
    groups = dict(dots) if isinstance(dots, Mapping) else {"": dots}
    if by_decade:
        x = np.log10(x)
    if in_decades:
        most = max(float(np.nanmax(values)) for values in (*groups.values(), *lines.values())) or 1.0
        groups = {name: _logarithm(values, most) for name, values in groups.items()}
        lines = {name: _logarithm(values, most) for name, values in lines.items()}
        band = None if band is None else (np.log10(band[0]), np.log10(band[1]))
        limits = None if limits is None else (float(np.log10(limits[0])), float(np.log10(limits[1])))
    every = np.concatenate((*groups.values(), *lines.values()))
    every = every[np.isfinite(every)] if limits is None else np.array(limits)
    across, up = _scale(x, LEFT, WIDTH - RIGHT), _scale(every, HEIGHT - BOTTOM, TOP)
    points = "".join(
        f'<g class="{escape(f"dots {name}".strip())}">'
        + "".join(
            f'<circle cx="{across(a):.1f}" cy="{up(b):.1f}" r="3"/>'
            for a, b in zip(x, values, strict=True)
            if np.isfinite(b)
        )
        + "</g>"
        for name, values in groups.items()
    )
    paths = "".join(
        f'<path class="{escape(name)}" d="'
        + "".join(
            f"{'L' if known[1] else 'M'}{across(a):.1f} {up(b):.1f}"
            for a, b, known in zip(x, values, _with_one_before(np.isfinite(values)), strict=True)
            if known[0]
        )
        + '"/>'
        for name, values in lines.items()
    )
    ticks = "".join(
        f'<path class="tick" d="M{across(v):.1f} {HEIGHT - BOTTOM:.1f}v5"/>'
        f'<text x="{_within(across(v), _text(v, by_decade)):.1f}" y="{HEIGHT - BOTTOM + 17:.1f}" '
        f'text-anchor="middle">{_text(v, by_decade)}</text>'
        for v in _ticks(x, by_decade)
    ) + "".join(
        f'<path class="grid" d="M{LEFT} {up(v):.1f}H{WIDTH - RIGHT}"/>'
        f'<text x="{LEFT - 6}" y="{up(v) + 4:.1f}" text-anchor="end">{_text(v, in_decades)}</text>'
        for v in _ticks(every, in_decades)
    )
    return Markup(
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT + 14:g}" class="cause" role="img" aria-label="{escape(spoken)}">'
        f"{_area(x, band, across, up)}{ticks}{paths}{points}"
        f'<text x="{(LEFT + WIDTH) / 2:g}" y="{HEIGHT + 10:g}" text-anchor="middle">{escape(label)}</text>'
        f'<text x="12" y="{HEIGHT / 2:g}" transform="rotate(-90 12 {HEIGHT / 2:g})" text-anchor="middle">'
        f"{escape(ordinate or ('force' if unit == 'N' else 'torque'))}, {escape(unit)}</text></svg>"
    )


def _within(place: float, text: str) -> float:
    """Return where the middle of a label stands that the right edge does not cut; letters are 9 wide at most."""
    return min(place, WIDTH - 4.5 * len(text))


def _area(x: FloatArray, band: tuple[FloatArray, FloatArray] | None, across: Scale, up: Scale) -> str:
    """Return the area between two edges, each stretch that is known on its own."""
    if band is None:
        return ""
    known = np.isfinite(band[0]) & np.isfinite(band[1])
    parts = np.split(np.arange(len(x)), np.flatnonzero(known[1:] != known[:-1]) + 1)
    drawn = []
    for part in (part for part in parts if len(part) and known[part[0]]):
        edge = [(x[i], band[0][i]) for i in part] + [(x[i], band[1][i]) for i in part[::-1]]
        drawn.append("M" + "L".join(f"{across(a):.1f} {up(b):.1f}" for a, b in edge) + "Z")
    return f'<path class="scatter" d="{"".join(drawn)}"/>' if drawn else ""


def _with_one_before(known: npt.NDArray[np.bool_]) -> list[tuple[bool, bool]]:
    """Return of each point whether it is known, and whether the one before is, too."""
    return list(zip(known.tolist(), [False, *known.tolist()], strict=False))


def _logarithm(values: FloatArray, most: float) -> FloatArray:
    found: FloatArray = np.log10(np.maximum(values, most * 10**-DECADES))
    return found


def _scale(values: FloatArray, first: float, last: float) -> Scale:
    low, high = float(values.min()), float(values.max())
    span = (high - low) or 1.0
    return lambda value: first + (last - first) * (value - low) / span


def _ticks(values: FloatArray, logarithmic: bool) -> list[float]:
    """About five round numbers within a range; of a logarithmic one powers of ten, or ones, twos and fives."""
    low, high = float(values.min()), float(values.max())
    if logarithmic:
        powers = range(int(np.floor(low)), int(np.ceil(high)) + 1)
        for steps in ((1.0,), (1.0, 2.0, 5.0))[0 if high - low > 2 else 1 :]:
            every = [float(power + np.log10(step)) for power in powers for step in steps]
            found = [value for value in every if low - 1e-9 <= value <= high + 1e-9]
            if len(found) >= FEWEST_TICKS:
                return found
        # Within less than a decade: round numbers, as on an axis of numbers.
        return [float(np.log10(v)) for v in _ticks(10.0 ** np.array([low, high]), False) if v > 0]
    raw = ((high - low) or 1.0) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda one: abs(one * power - raw))
    return [float(k * step) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _text(value: float, logarithmic: bool) -> str:
    shown = 10.0**value if logarithmic else value
    text = f"{shown:.0f}" if 1e3 <= abs(shown) < 1e5 else f"{0.0 if abs(shown) < 1e-12 else shown:.3g}"
    return text.replace("-", "−")
