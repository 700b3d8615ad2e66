"""What a fit estimated, drawn: numbers beside those it began with, and which of them the data cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robid_core.artifacts import Fit
from robid_core.errors import ConfigurationError
from robid_core.plot.arguments import check_kind
from robid_core.plot.rounding import compact, rounded_to
from robid_core.plot.style import MEASURED, MODEL, START, axis, layout, plain, shown, title

NORMAL_95 = 1.959964  # standard errors on either side
ROW, CELL = 22, 26  # pixels of a parameter
SPRINGS = ("stiffness",)


def parameters(fit: Fit, everything: bool = False) -> Any:
    """Return a figure of estimates relative to what the fit began with, in percent, with 95 % intervals.

    A parameter that was held has no interval; one that began at zero has no place in percent and is left out.

    Parameters
    ----------
    fit
        Any fit.
    everything
        All parameters in place of those that are reported.

    Raises
    ------
    ConfigurationError
        Where no parameter is left.

    Examples
    --------
    >>> import robid_core as robid
    >>> from robid_core.testing import example_fit
    >>> figure = robid.plot.parameters(example_fit(robid.Robot.load("one_axis")))
    >>> figure.data[0].y, figure.layout.xaxis.title.text
    (('gear_stiffness.axis_1',), 'estimate against start, %')
    """
    check_kind("parameters: fit", fit, Fit)
    table = fit.parameters
    chosen = np.flatnonzero((table.reported | everything) & (table.start != 0))
    if not chosen.size:
        raise ConfigurationError(
            f"{fit.method} has no {'' if everything else 'reported '}parameter that began at a number other than zero"
        )
    start, estimate = table.start[chosen], table.estimate[chosen]
    share = 100 * (estimate / start - 1)
    reach = 100 * NORMAL_95 * table.standard_error[chosen] / np.abs(start)
    names = [plain(table.names[i]) for i in chosen]
    told = [f"{value:.5g} {plain(table.units[i])}" for value, i in zip(estimate, chosen, strict=True)]
    trace = {
        "x": rounded_to(share, 6),
        "y": names,
        "text": told,
        "mode": "markers",
        "name": "estimate",
        "marker": {"color": MODEL, "size": 7},
        "error_x": {"type": "data", "array": rounded_to(reach, 6), "color": MODEL, "thickness": 1.4},
        "hovertemplate": "%{y}: %{text}, %{x:+.3g} %<extra></extra>",
    }
    line = {"type": "line", "x0": 0, "x1": 0, "y0": 0, "y1": 1, "yref": "paper"}
    shape = {**line, "line": {"color": START, "width": 1.2, "dash": "4px,3px"}}
    look = layout(70 + ROW * len(names), 40, 8, 40, shapes=[shape])
    look["xaxis"] = axis(title=title("estimate against start, %"))
    look["yaxis"] = axis(autorange="reversed", type="category")
    return shown({"data": [trace], "layout": look})


def correlation(fit: Fit, groups: Sequence[str] = SPRINGS) -> Any:
    """Return a heat map of the correlations of estimates, by default of the springs: what the data tell together only.

    Parameters
    ----------
    fit
        With a covariance.
    groups
        Of parameters, as the table's column `group` has them.

    Raises
    ------
    ConfigurationError
        Where fewer than two parameters of these groups have a known covariance.

    Examples
    --------
    >>> import robid_core as robid
    >>> from robid_core.testing import example_fit, example_robot
    >>> figure = robid.plot.correlation(example_fit(example_robot(2)))
    >>> figure.data[0].x
    ('gear_stiffness.axis_1', 'gear_stiffness.axis_2')
    """
    check_kind("correlation: fit", fit, Fit)
    table = fit.parameters
    group_of = dict(zip(table.names, table.groups, strict=True))
    variance = np.diagonal(fit.covariance)
    chosen = [
        i
        for i, name in enumerate(fit.free_names[: len(variance)])
        if group_of.get(name) in groups and np.isfinite(variance[i]) and variance[i] > 0
    ]
    if len(chosen) < 2:
        known = ", ".join(dict.fromkeys(group_of[name] for name in fit.free_names if name in group_of))
        raise ConfigurationError(
            f"{fit.method} has no covariance of two parameters of {', '.join(groups)}; it estimated {known or 'none'}"
        )
    matrix = fit.correlation([fit.free_names[i] for i in chosen])
    names = [plain(fit.free_names[i]) for i in chosen]
    trace = {
        "type": "heatmap",
        "x": names,
        "y": names,
        "z": compact(matrix, 4),
        "zmin": -1,
        "zmax": 1,
        "colorscale": [[0, MODEL], [0.5, "rgba(128,128,128,0.06)"], [1, MEASURED]],
        "colorbar": {"title": {"text": "correlation"}, "thickness": 12},
        "xgap": 1,
        "ygap": 1,
        "name": "correlation",
        "hovertemplate": "%{y}, %{x}: %{z:+.2f}<extra></extra>",
    }
    look = layout(150 + CELL * len(names), 40, 8, 40)
    look["xaxis"] = axis(type="category")
    look["yaxis"] = axis(type="category", autorange="reversed")
    return shown({"data": [trace], "layout": look})
