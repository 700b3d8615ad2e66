"""Figures that a notebook asks for: `robid.plot.response(frf, fit).show()`."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core.artifacts import Diagnosis, Fit, Frf, Record
from robid_core.errors import ConfigurationError
from robid_core.plot.arguments import axis_number, check_kind, check_number
from robid_core.plot.bode import Entry, beside, bode, comparison_of
from robid_core.plot.curves import friction_curves, residual_curves, side_by_side
from robid_core.plot.panels import (
    DECADES,
    PANEL,
    distortion_panels,
    level_of_response,
    panel_layout,
    residual_panels,
)
from robid_core.plot.style import columns_of, shown
from robid_core.plot.traces import traces
from robid_core.robot import Robot


def response(
    frf: Frf | None = None,
    model: Fit | Robot | None = None,
    *,
    configuration: int = 0,
    output: str | None = None,
    input: str | None = None,
) -> Any:
    """Return a figure of measured responses beside those of a model.

    Parameters
    ----------
    frf
        The measured response; None where the fit has one.
    model
        A fit of responses, or a robot; None: what was measured alone.
    configuration
        Counted from zero.
    output, input
        Axis of the acceleration and of the torque; by default all axes, each over its own torque.

    Raises
    ------
    ConfigurationError
        Where there is nothing to draw, or no such axis or configuration.

    Examples
    --------
    >>> import robid_core as robid
    >>> from robid_core.testing import example_frf
    >>> robot = robid.Robot.load("one_axis")
    >>> figure = robid.plot.response(example_frf(robot), robot)
    >>> [trace.name for trace in figure.data]
    ['two standard deviations', 'robot file', 'measured', 'robot file', 'measured']
    """
    check_kind("response: frf", frf, Frf, type(None))
    check_kind("response: model", model, Fit, Robot, type(None))
    fitted = isinstance(model, Fit) and model.response is not None
    if isinstance(model, Fit) and model.response is not None:
        comparison = model.response
    elif frf is None:
        raise ConfigurationError("there is no response to draw; give an Frf, or a fit of responses")
    elif isinstance(model, Fit):
        found = None if model.model is None else Robot.of_model(model.model)
        if found is None:
            raise ConfigurationError("the fit has neither a response nor a model; give a robot in its place")
        comparison, fitted = beside(frf, found), True
    elif model is not None:
        comparison = beside(frf, model)
    else:
        comparison = comparison_of(frf, np.full(frf.response.shape, 0j))
    check_number("configuration", configuration, len(comparison.measured))
    entries = _entries(comparison.axis_names, output, input)
    columns = columns_of(len(entries))
    figure = bode(comparison, configuration, entries, fitted, columns, 440 if columns == 1 else 300)
    if model is None:
        figure["data"] = [one for one in figure["data"] if one["name"] != "robot file"]
    return shown(figure)


def time(result: Fit | Diagnosis, axis: str | None = None, index: int = 0) -> Any:
    """Return a figure of measured and simulated values over time, and of their difference.

    Parameters
    ----------
    result
        A fit or a diagnosis that compares over time.
    axis
        Name of the axis; by default the first.
    index
        Which of its comparisons.

    Raises
    ------
    ConfigurationError
        Where there is no such comparison or axis.

    Examples
    --------
    >>> import robid_core as robid
    >>> from robid_core.testing import example_diagnosis
    >>> figure = robid.plot.time(example_diagnosis(robid.Robot.load("one_axis")))
    >>> [trace.name for trace in figure.data]
    ['measured', 'simulated', 'residual']
    """
    check_kind("time: result", result, Fit, Diagnosis)
    if not 0 <= index < len(result.time):
        if not result.time:
            raise ConfigurationError(f"{result.method} compares nothing over time{_drawn(result)}")
        raise ConfigurationError(
            f"{result.method} has comparisons 0 to {len(result.time) - 1} over time, none of number {index}"
        )
    comparison = result.time[index]
    return shown(traces(comparison, 0 if axis is None else axis_number(comparison.axis_names, axis)))


def friction(fit: Fit) -> Any:
    """Return a figure of friction over speed, for a fit that was made at constant speeds.

    Raises ConfigurationError where the fit has none.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> from robid_core.testing import example_fit
    >>> speed = np.array([-2.0, -1.0, 1.0, 2.0])
    >>> curve = robid.FrictionCurve("axis_1", "coulomb", "rad/s", "N m", speed, np.sign(speed), np.sign(speed))
    >>> figure = robid.plot.friction(example_fit(robid.Robot.load("one_axis")).replace(friction=(curve,)))
    >>> figure.layout.xaxis.title.text, figure.data[0].y
    ('motor speed, rad/s', (-1, -1, 1, 1))
    """
    check_kind("friction: fit", fit, Fit)
    if not fit.friction:
        raise ConfigurationError(f"{fit.method} has no friction over speed; fit.friction has")
    return shown(side_by_side(friction_curves(fit.friction)))


def residuals(result: Diagnosis | Fit, axis: str | None = None, *, configuration: int = 0) -> Any:
    """Return a figure of what a model leaves.

    Parameters
    ----------
    result
        A diagnosis: torque that is left on an axis, over all that it may be a function of. A fit of responses: what is
        left of each axis' own response in standard errors of the measurement; 95 % lie below the line where the model
        is right.
    axis
        Name of the axis; by default the first that a diagnosis has curves of, of a fit all axes.
    configuration
        Of a fit, counted from zero.

    Raises
    ------
    ConfigurationError
        Where the result has no such residuals, or no such axis or configuration.

    Examples
    --------
    >>> import robid_core as robid
    >>> from robid_core.testing import example_fit
    >>> figure = robid.plot.residuals(example_fit(robid.Robot.load("one_axis")))
    >>> [trace.name for trace in figure.data], figure.layout.yaxis.title.text
    (['95 % of chance', 'residual'], 'std. errors')
    """
    check_kind("residuals: result", result, Diagnosis, Fit)
    if isinstance(result, Fit):
        return _response_residuals(result, axis, configuration)
    known = tuple(dict.fromkeys(one.axis for one in result.residuals))
    if not known:
        raise ConfigurationError(f"{result.method} has no residuals of any axis; diagnosis.effects has")
    wanted = known[axis_number(known, axis or known[0])]
    return shown(side_by_side(residual_curves([one for one in result.residuals if one.axis == wanted])))


def distortion(frf: Frf, record: Record | None = None, *, configuration: int = 0) -> Any:
    """Return a figure of levels of distortion and noise over frequency, of the acceleration of each axis.

    Parameters
    ----------
    frf
        A response whose estimator saw the bins that were not excited.
    record
        What it was estimated from: draws the level of the response beside them.
    configuration
        Counted from zero.

    Raises
    ------
    ConfigurationError
        Where the response has no levels of distortion, or no such configuration, or the record is another one's.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> from robid_core.testing import example_frf
    >>> frf = example_frf(robid.Robot.load("one_axis"))
    >>> frf = frf.replace(odd_distortion=np.full(frf.response.shape[:3], 0.02))
    >>> [trace.name for trace in robid.plot.distortion(frf).data]
    ['odd distortion', 'noise']
    """
    check_kind("distortion: frf", frf, Frf)
    check_kind("distortion: record", record, Record, type(None))
    if frf.odd_distortion is None and frf.even_distortion is None:
        raise ConfigurationError(
            f"{frf.estimator} has no levels of distortion; estimators have where odd or even bins were left free"
        )
    check_number("configuration", configuration, len(frf.response))
    level = None
    if record is not None:
        level = level_of_response(record.spectra()[1])
        if level.shape != (len(frf.response), len(frf.frequency_hz), len(frf.axis_names)):
            raise ConfigurationError("the record has other configurations, lines or axes than the response")
        level = level[configuration]
    columns = columns_of(len(frf.axis_names))
    data = distortion_panels(frf, configuration, level)
    return shown({"data": data, "layout": panel_layout(frf.axis_names, "rad/s²", columns, PANEL, DECADES)})


def _response_residuals(fit: Fit, axis: str | None, configuration: int) -> Any:
    """Return the panels of a fit of responses, of one axis or of all."""
    comparison = fit.response
    if comparison is None or not np.isfinite(np.einsum("cfii->cfi", comparison.deviation)).any():
        raise ConfigurationError(
            f"{fit.method} has no residuals of responses with known deviations{_drawn(fit)}"
        )
    check_number("configuration", configuration, len(comparison.measured))
    if axis is not None:
        place = [axis_number(comparison.axis_names, axis)]
        comparison = comparison.select("n_out", place).select("n_in", place).replace(axis_names=(axis,))
    names = comparison.axis_names
    layout = panel_layout(names, "std. errors", columns_of(len(names)), PANEL, {"rangemode": "tozero"})
    return shown({"data": residual_panels(comparison, configuration), "layout": layout})


def _drawn(result: Fit | Diagnosis) -> str:
    """Say which figures show what this result leaves, for those that ask for one that it has not."""
    ways = ["plot.time draws what it leaves over time"] if result.time else []
    if isinstance(result, Fit):
        ways += ["plot.friction draws its friction over speed"] if result.friction else []
        ways += (
            ["its misfit_table has the misfit by axis and band"] if result.misfit_table is not None else []
        )
    ways += ["a diagnosis (diagnosis.effects) draws residual torques"] if isinstance(result, Fit) else []
    return "".join(f"; {way}" for way in ways)


def _entries(names: tuple[str, ...], output: str | None, into: str | None) -> list[Entry]:
    if output is None and into is None:
        return [(place, place, name) for place, name in enumerate(names)]
    first, second = output or into or names[0], into or output or names[0]
    heading = f"acceleration of {first} over torque of {second}"
    return [(axis_number(names, first), axis_number(names, second), heading)]
