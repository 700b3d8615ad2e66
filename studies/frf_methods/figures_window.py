"""A window of the local methods (thesis fig. 3.4): data, lines that take part, and the functions fitted to them.

At a few instructive lines, with all experiments, those of one block, and a single one. Direct approach, second order,
windows as the estimators choose them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from robid_core import ComplexArray, FloatArray, Record, RobidError
from robid_core.estimation.response.local.fit import local_rational
from robid_core.estimation.response.local.model import LocalModel, Parametrization
from robid_core.estimation.response.local.result import LocalFit
from robid_core.estimation.response.spectra import divide_spectra, side_by_side
from studies.frf_methods.figures_style import FITS, INK, laid_out, plain_ticks

PARAMETRIZATIONS: tuple[Parametrization, ...] = ("scalar", "miso", "mimo")
NEIGHBOURS = 4  # lines on either side that tell what a line is like
STEPS_HZ = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0)
CURVE = 81  # points of a drawn function
RAW, INSIDE = "#b3bdc7", "#4a5763"


@dataclass(frozen=True, eq=False)
class Case:
    """A line and an entry worth looking at."""

    key: str
    title: str
    line: int
    output: int
    input: int


@dataclass(frozen=True, eq=False)
class Spectra:
    """Torque and acceleration of so many experiments of a configuration, (n_freq, n_axis, n_exp), and a raw response.

    `raw` (n_freq, n_out, n_in) is H1; of fewer experiments than axes the plain ratio of an output to an input, of the
    first experiment.
    """

    frequency_hz: FloatArray
    u: ComplexArray
    y: ComplexArray
    raw: ComplexArray


def counts(record: Record) -> tuple[int, ...]:
    """Numbers of experiments that are shown: all, one block, one."""
    n_block, n_exp = record.run.valid.shape[1:3]
    return tuple(dict.fromkeys((n_block * n_exp, n_exp, 1)))


def spectra(record: Record, count: int) -> Spectra:
    """Spectra of the first experiments of the first configuration."""
    block_u, block_y = record.spectra()
    u, y = side_by_side(block_u)[0][..., :count], side_by_side(block_y)[0][..., :count]
    enough = count >= u.shape[1]
    raw = divide_spectra(u, y).value if enough else y[:, :, None, 0] / u[:, None, :, 0]
    return Spectra(record.frequency_hz, u, y, raw)


def local_fits(data: Spectra) -> dict[Parametrization, LocalFit]:
    """The three parametrisations; one that has not enough lines is left out."""
    found = {}
    for name in PARAMETRIZATIONS:
        try:
            found[name] = local_rational(data.u, data.y, data.frequency_hz, LocalModel(name))
        except RobidError:
            continue
    return found


def cases(frequency_hz: FloatArray, response: ComplexArray) -> list[Case]:
    """The lowest lines, the deepest dip, the sharpest peak and the flattest stretch of the diagonal, and a coupling.

    By how far the level of a line is from the mean level of the lines around it.
    """
    level = np.log(np.abs(np.einsum("fii->fi", response)))
    stretch = np.lib.stride_tricks.sliding_window_view(level, 2 * NEIGHBOURS + 1, axis=0)
    away = stretch[..., NEIGHBOURS] - stretch.mean(axis=-1)
    spread = np.ptp(stretch, axis=-1)
    places = {
        "low": ("Low frequency", 1, min(1, level.shape[1] - 1)),
        "dip": ("Antiresonance", *_lowest(away)),
        "peak": ("Resonance", *_lowest(-away)),
        "flat": ("Flat part", *_lowest(spread)),
    }
    found = [
        Case(
            key, f"{title}: {frequency_hz[line]:.1f} Hz, motor {axis + 1} by its own torque", line, axis, axis
        )
        for key, (title, line, axis) in places.items()
    ]
    return found + coupled_case(frequency_hz, response)


def coupled_case(frequency_hz: FloatArray, response: ComplexArray) -> list[Case]:
    """The highest line of the entry off the diagonal that is largest against its row and column; none of one axis."""
    n_axis = response.shape[1]
    if n_axis == 1:
        return []
    size = np.abs(response)
    own = np.einsum("fii->fi", size)
    share = np.nanmedian(size / np.sqrt(own[:, :, None] * own[:, None, :]), axis=0)
    output, source = divmod(int(np.argmax(np.where(np.eye(n_axis, dtype=bool), 0.0, share))), n_axis)
    line = int(np.nanargmax(size[:, output, source]))
    title = f"Coupling: {frequency_hz[line]:.1f} Hz, motor {output + 1} by the torque of motor {source + 1}"
    return [Case("coupling", title, line, output, source)]


def _lowest(values: FloatArray) -> tuple[int, int]:
    row, axis = np.unravel_index(np.nanargmin(values), values.shape)
    return int(row) + NEIGHBOURS, int(axis)


def window_figure(
    case: Case, data: Spectra, fits: dict[Parametrization, LocalFit], truth: ComplexArray | None
) -> go.Figure:
    """One entry over the whole band, in the window of one line, and how far data and functions there are off.

    `truth` (n_freq, n_out, n_in) is the best linear approximation; without it the last part is left out.
    """
    entry = (slice(None), case.output, case.input)
    heights = (0.3, 0.7) if truth is None else (0.22, 0.45, 0.33)
    figure = make_subplots(rows=len(heights), cols=1, vertical_spacing=0.07, row_heights=heights)
    frequency, raw = data.frequency_hz, np.abs(data.raw[entry])
    widest = max(fits.values(), key=lambda fit: int(fit.windows.size[case.line]), default=None)
    first, last = (
        (0, len(frequency) - 1) if widest is None else (widest.first[case.line], widest.last[case.line])
    )
    inside = slice(first, last + 1)
    _points(figure, 1, frequency, raw, mode="markers", marker={"color": RAW, "size": 4})
    _points(figure, 2, frequency[inside], raw[inside], mode="markers", marker={"color": INSIDE, "size": 7})
    seen = [raw[inside]]
    if truth is not None:
        known = np.abs(truth[entry])
        line = {"color": INK, "width": 1.2, "dash": "4px,3px"}
        _points(figure, 1, frequency, known, mode="lines", line=line)
        _points(figure, 2, frequency[inside], known[inside], mode="lines", line=line)
        off = 100 * np.abs(data.raw[entry] / truth[entry] - 1)[inside]
        _points(figure, 3, frequency[inside], off, mode="markers", marker={"color": INSIDE, "size": 5})
        seen.append(known[inside])
    for name, fit in fits.items():
        lines = np.arange(fit.first[case.line], fit.last[case.line] + 1)
        at_lines = fit.around(case.line, frequency[lines])[entry]
        grid = np.geomspace(frequency[lines[0]], frequency[lines[-1]], CURVE)
        line = {"color": FITS[name], "width": 2.6 if name == "mimo" else 1.8}
        for row in (1, 2):
            _points(figure, row, grid, np.abs(fit.around(case.line, grid)[entry]), mode="lines", line=line)
        seen.append(np.abs(at_lines))
        if truth is not None:
            off = 100 * np.abs(at_lines / truth[entry][lines] - 1)
            _points(figure, 3, frequency[lines], off, mode="lines", line={**line, "width": 1.6})
            here, outline = lines == case.line, {"color": "#fff", "width": 1}
            marker = {"color": FITS[name], "size": 10, "symbol": "diamond", "line": outline}
            _points(figure, 3, frequency[lines][here], off[here], mode="markers", marker=marker)
    for edge in _short(frequency[[first, last]]):
        figure.add_vline(x=edge, line={"color": INK, "width": 1.2, "dash": "dot"}, row=1, col=1)
    return _with_axes(figure, frequency, inside, np.concatenate(seen), len(heights))


def _with_axes(
    figure: go.Figure, frequency: FloatArray, inside: slice, seen: FloatArray, rows: int
) -> go.Figure:
    """The whole band above, the window below it; sizes as they are found at the lines."""
    figure.update_xaxes(**_frequency_axis(frequency), row=1, col=1)
    for row in range(2, rows + 1):
        figure.update_xaxes(**_frequency_axis(frequency[inside]), showticklabels=row == rows, row=row, col=1)
    figure.update_xaxes(title_text="frequency, Hz", row=rows, col=1)
    figure.update_yaxes(type="log", exponentformat="power", dtick=1, row=1, col=1)
    figure.update_yaxes(**plain_ticks(seen.tolist()), title_text="|G|, (rad/s²)/(N m)", row=2, col=1)
    if rows == 3:
        figure.update_yaxes(**plain_ticks([0.3, 150.0]), title_text="off G<sub>BLA</sub>, %", row=3, col=1)
    figure.update_yaxes(tickfont={"size": 11.5})
    figure.update_xaxes(tickfont={"size": 11.5})
    margin = {"l": 60, "r": 10, "t": 8, "b": 46}
    return laid_out(figure, 190 * rows, showlegend=False, hovermode="closest", margin=margin)


def _frequency_axis(frequency: FloatArray) -> dict[str, object]:
    """Logarithmic axis over some lines, with four to eight numbers."""
    low, high = float(frequency[0]), float(frequency[-1])
    if high < 2.5 * low:
        step = next(step for step in STEPS_HZ if (high - low) / step < 6)
        ticks = [round(step * n, 6) for n in range(int(np.ceil(low / step)), int(high / step) + 1)]
    else:
        ticks = [digit * 10.0**decade for decade in range(-2, 4) for digit in (1, 2, 3, 5, 7)]
    ticks = [f for f in ticks if low <= f <= high]
    words = [f"{f:.6g}" for f in ticks]
    span = [float(np.log10(0.99 * low)), float(np.log10(1.01 * high))]
    return {"type": "log", "range": span, "tickvals": ticks, "ticktext": words, "tickangle": 0}


def _points(figure: go.Figure, row: int, x: FloatArray, y: FloatArray, **looks: object) -> None:
    figure.add_scatter(x=_short(x), y=_short(y), row=row, col=1, **looks)


def _short(values: Sequence[float] | FloatArray) -> list[float]:
    return [float(f"{value:.5g}") for value in values]


def window_figures(
    record: Record, truth: ComplexArray | None
) -> tuple[list[Case], dict[int, dict[str, go.Figure]], dict[int, dict[str, int]]]:
    """Cases; by number of experiments and case the figures; by number and parametrisation the lines of a window."""
    numbers = counts(record)
    figures: dict[int, dict[str, go.Figure]] = {}
    sizes: dict[int, dict[str, int]] = {}
    chosen: list[Case] = []
    for count in numbers:
        data = spectra(record, count)
        fits = local_fits(data)
        if not chosen:
            best = fits["mimo"].response if "mimo" in fits else data.raw
            chosen = cases(data.frequency_hz, best)
        figures[count] = {case.key: window_figure(case, data, fits, truth) for case in chosen}
        sizes[count] = {name: int(fit.windows.size.max()) for name, fit in fits.items()}
    return chosen, figures, sizes
