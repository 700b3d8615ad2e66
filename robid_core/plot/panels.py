"""Panels over frequency, one for each axis: residuals in standard deviations, and levels of distortion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import Frf, ResponseComparison
from robid_core.plot.bode import TICK_TEXT, TICKS
from robid_core.plot.rounding import rounded_to
from robid_core.plot.style import INK, MEASURED, MODEL, RESIDUAL, START, axis, layout, plain, title

WITHIN = float(np.sqrt(-np.log(0.05)))  # 95 % of complex Gaussian errors, over the root of their mean square
COLOURS = {"response": START, "odd distortion": MODEL, "even distortion": MEASURED, "noise": RESIDUAL}


def residual_panels(comparison: ResponseComparison, configuration: int) -> list[dict[str, Any]]:
    """Return what is left of each axis' own response in standard deviations of the measurement.

    ``|measured - modelled| / deviation``, a dot for each line, and a line below which 95 % lie where the model is right
    and the deviation known (1.73: the size of a complex Gaussian error over the root of its mean square).
    """
    f = comparison.frequency_hz
    found = []
    for a in range(len(comparison.axis_names)):
        own = (configuration, slice(None), a, a)
        size = np.abs(comparison.measured[own] - comparison.modelled[own])
        with np.errstate(divide="ignore", invalid="ignore"):
            errors = np.where(comparison.deviation[own] > 0, size / comparison.deviation[own], np.nan)
        limit = {"mode": "lines", "line": {"color": START, "width": 1.2, "dash": "4px,3px"}}
        found.append(_trace(a, f[[0, -1]], np.full(2, WITHIN), "95 % of chance", **limit))
        marker = {"color": MODEL, "size": 4}
        found.append(_trace(a, f, errors, "residual", mode="markers", marker=marker))
    return found


def distortion_panels(
    frf: Frf, configuration: int, response: FloatArray | None = None
) -> list[dict[str, Any]]:
    """Return levels of each axis' acceleration in one experiment: response, odd and even distortion, noise.

    Parameters
    ----------
    frf
        With levels of distortion.
    configuration
        Counted from zero.
    response
        Root mean square of the response's coefficients, (n_freq, n_axis); none if left out.
    """
    noise = None
    if frf.noise_covariance is not None:
        noise = np.sqrt(np.einsum("fii->fi", frf.noise_covariance[configuration]).real)
    levels = {
        "response": response,
        "odd distortion": _of(frf.odd_distortion, configuration),
        "even distortion": _of(frf.even_distortion, configuration),
        "noise": noise,
    }
    found = []
    for a in range(len(frf.axis_names)):
        for name, level in levels.items():
            if level is not None:
                line = {"color": COLOURS[name], "width": 1.6}
                values = np.where(level[:, a] > 0, level[:, a], np.nan)
                found.append(_trace(a, frf.frequency_hz, values, name, mode="lines", line=line))
    return found


PANEL = 190  # pixels of a row of panels without a phase
DECADES = {"type": "log", "exponentformat": "power", "dtick": 1}


def level_of_response(accelerations: ComplexArray) -> FloatArray:
    """Root mean square of the accelerations' coefficients over blocks and experiments, (n_config, n_freq, n_axis).

    Parameters
    ----------
    accelerations
        As `Record.spectra` gives them, (n_config, n_block, n_freq, n_axis, n_exp).
    """
    level: FloatArray = np.sqrt((np.abs(accelerations) ** 2).mean(axis=(1, 4)))
    return level


def panel_layout(
    names: Sequence[str], unit: str, columns: int, height: int, scale: Mapping[str, Any]
) -> dict[str, Any]:
    """Return where the panel of each axis stands; `scale` are settings of the ordinates."""
    rows = -(-len(names) // columns)
    gap_x, gap_y = (0.07 if columns > 1 else 0.0), (0.36 / rows if rows > 1 else 0.0)
    width, tall = (1 - gap_x * (columns - 1)) / columns, (1 - gap_y * (rows - 1)) / rows
    found = layout(height * rows, 50, 24, 38, annotations=[], hovermode="closest")
    for place, name in enumerate(names):
        row, column = divmod(place, columns)
        number = "" if place == 0 else str(place + 1)
        left, bottom = column * (width + gap_x), 1 - (row + 1) * tall - row * gap_y
        domain = [round(max(left, 0.0), 4), round(min(left + width, 1.0), 4)]
        top = round(min(bottom + tall, 1.0), 4)
        under = {"title": title("Hz")} if row == rows - 1 else {}
        ticks = {"tickvals": TICKS, "ticktext": TICK_TEXT}
        found[f"xaxis{number}"] = axis(type="log", domain=domain, anchor=f"y{number}", **ticks, **under)
        found[f"yaxis{number}"] = axis(
            domain=[round(max(bottom, 0.0), 4), top],
            anchor=f"x{number}",
            nticks=5,
            **({"title": title(unit, 2)} if column == 0 else {}),
            **scale,
        )
        heading = {"text": plain(name), "x": domain[0], "y": top, "xref": "paper", "yref": "paper"}
        where = {"xanchor": "left", "yanchor": "bottom", "showarrow": False}
        found["annotations"].append({**heading, **where, "font": {"size": 13, "color": INK}})
    return found


def _of(levels: FloatArray | None, configuration: int) -> FloatArray | None:
    return None if levels is None else levels[configuration]


def _trace(place: int, x: FloatArray, y: FloatArray, name: str, **look: Any) -> dict[str, Any]:
    number = "" if place == 0 else str(place + 1)
    return {
        "x": rounded_to(x, 6),
        "y": rounded_to(y, 6) if np.isfinite(y).any() else [None] * len(y),
        "name": name,
        "hovertemplate": "%{x:.3g} Hz, %{y:.3g}<extra>" + name + "</extra>",
        "xaxis": f"x{number}",
        "yaxis": f"y{number}",
        **look,
    }
