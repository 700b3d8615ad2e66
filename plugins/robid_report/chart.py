"""Small charts as SVG: dots and lines over one variable."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from markupsafe import Markup, escape

from robid_core import FloatArray

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560.0, 240.0, 80.0, 12.0, 12.0, 34.0
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
    """
    by_decade, in_decades = logarithmic
    groups = dict(dots) if isinstance(dots, Mapping) else {"": dots}
    if by_decade:
        x = np.log10(x)
    if in_decades:
        most = max(float(np.nanmax(values)) for values in (*groups.values(), *lines.values())) or 1.0
        groups = {name: _logarithm(values, most) for name, values in groups.items()}
        lines = {name: _logarithm(values, most) for name, values in lines.items()}
    every = np.concatenate((*groups.values(), *lines.values()))
    every = every[np.isfinite(every)]
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
        f'<text x="{across(v):.1f}" y="{HEIGHT - BOTTOM + 17:.1f}" text-anchor="middle">{_text(v, by_decade)}</text>'
        for v in _ticks(x, by_decade)
    ) + "".join(
        f'<path class="grid" d="M{LEFT} {up(v):.1f}H{WIDTH - RIGHT}"/>'
        f'<text x="{LEFT - 6}" y="{up(v) + 4:.1f}" text-anchor="end">{_text(v, in_decades)}</text>'
        for v in _ticks(every, in_decades)
    )
    return Markup(
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT + 14:g}" class="cause" role="img" aria-label="{escape(spoken)}">'
        f"{ticks}{paths}{points}"
        f'<text x="{(LEFT + WIDTH) / 2:g}" y="{HEIGHT + 10:g}" text-anchor="middle">{escape(label)}</text>'
        f'<text x="12" y="{HEIGHT / 2:g}" transform="rotate(-90 12 {HEIGHT / 2:g})" text-anchor="middle">'
        f"{escape(ordinate or ('force' if unit == 'N' else 'torque'))}, {escape(unit)}</text></svg>"
    )


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
        steps = (1.0,) if high - low > 2 else (1.0, 2.0, 5.0)
        powers = range(int(np.floor(low)), int(np.ceil(high)) + 1)
        every = [float(power + np.log10(step)) for power in powers for step in steps]
        return [value for value in every if low <= value <= high]
    raw = ((high - low) or 1.0) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda one: abs(one * power - raw))
    return [float(k * step) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _text(value: float, logarithmic: bool) -> str:
    shown = 10.0**value if logarithmic else value
    text = f"{shown:.0f}" if 1e3 <= abs(shown) < 1e5 else f"{0.0 if abs(shown) < 1e-12 else shown:.3g}"
    return text.replace("-", "−")
