"""Figures that a notebook asks for: `robid.plot.response(frf, fit).show()`."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core.artifacts import Diagnosis, Fit, Frf, ResponseComparison
from robid_core.errors import ConfigurationError
from robid_core.plot.bode import Entry, bode, comparison_of
from robid_core.plot.curves import friction_curves, residual_curves, side_by_side
from robid_core.plot.style import Figure
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
    fitted = isinstance(model, Fit) and model.response is not None
    if isinstance(model, Fit) and model.response is not None:
        comparison = model.response
    elif frf is None:
        raise ConfigurationError("there is no response to draw; give an Frf, or a fit of responses")
    elif isinstance(model, Fit):
        found = None if model.model is None else Robot.of_model(model.model)
        if found is None:
            raise ConfigurationError("the fit has neither a response nor a model; give a robot in its place")
        comparison, fitted = _beside(frf, found), True
    elif model is not None:
        comparison = _beside(frf, model)
    else:
        comparison = comparison_of(frf, np.full(frf.response.shape, 0j))
    if not 0 <= configuration < len(comparison.measured):
        raise ConfigurationError(
            f"there is no configuration {configuration}; they are 0 to {len(comparison.measured) - 1}"
        )
    entries = _entries(comparison.axis_names, output, input)
    columns = 1 if len(entries) == 1 else 2 if len(entries) <= 4 else 3
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
    if index >= len(result.time):
        raise ConfigurationError(f"it has {len(result.time)} comparisons over time, no number {index}")
    comparison = result.time[index]
    return shown(traces(comparison, 0 if axis is None else _place(comparison.axis_names, axis)))


def friction(fit: Fit) -> Any:
    """Return a figure of friction over speed, for a fit that was made at constant speeds.

    Raises ConfigurationError where the fit has none.
    """
    if not fit.friction:
        raise ConfigurationError(f"{fit.method} has no friction over speed; fit.friction has")
    return shown(side_by_side(friction_curves(fit.friction)))


def residuals(diagnosis: Diagnosis, axis: str | None = None) -> Any:
    """Return a figure of the torque that is left on an axis, over all that it may be a function of.

    Raises ConfigurationError where the diagnosis has no such curves.
    """
    curves = [one for one in diagnosis.residuals if one.axis == (axis or diagnosis.residuals[0].axis)]
    if not curves:
        raise ConfigurationError(f"{diagnosis.method} has no residuals of {axis or 'any axis'}")
    return shown(side_by_side(residual_curves(curves)))


def shown(figure: Figure) -> Any:
    """Return a Plotly figure of plain values."""
    import plotly.graph_objects  # slow to import

    return plotly.graph_objects.Figure(figure)


def _beside(frf: Frf, robot: Robot) -> ResponseComparison:
    """Return a response beside a robot's, friction as it damps under the motion that was measured."""
    between = ResponseComparison.frequencies_of_curves(frf.frequency_hz)
    damping = None
    if frf.speed_rms is not None and frf.slow_sine_speed is not None:
        damping = robot.equivalent_motor_damping(frf.speed_rms, frf.slow_sine_speed, frf.frequency_hz)
    return comparison_of(
        frf,
        robot.response(frf.angle, frf.frequency_hz, damping, hold=frf.torque_hold),
        (between, robot.response(frf.angle, between, damping, hold=frf.torque_hold)),
    )


def _entries(names: tuple[str, ...], output: str | None, into: str | None) -> list[Entry]:
    if output is None and into is None:
        return [(place, place, name) for place, name in enumerate(names)]
    first, second = output or into or names[0], into or output or names[0]
    heading = f"acceleration of {first} over torque of {second}"
    return [(_place(names, first), _place(names, second), heading)]


def _place(names: tuple[str, ...], name: str) -> int:
    if name not in names:
        raise ConfigurationError(f"there is no axis '{name}'; there are: {', '.join(names)}")
    return names.index(name)
